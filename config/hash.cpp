// SPDX-License-Identifier: Apache-2.0
#include "config/hash.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <span>
#include <system_error>

#include "config/bundle_name.hpp"
#include "config/document.hpp"
#include "config/load.hpp"
#include "config/sha256.hpp"

namespace takt::config {

std::string sha256_hex(std::string_view bytes) {
  Sha256 sha;
  sha.add(std::as_bytes(std::span(bytes)));
  return sha.hex();
}

std::uint64_t leading_64_bits(std::string_view sha256_hex) {
  std::uint64_t value = 0;
  std::from_chars(sha256_hex.data(), sha256_hex.data() + std::min<std::size_t>(16, sha256_hex.size()), value, 16);
  return value;
}

std::uint64_t joint_names_hash(const RobotConfig& robot) {
  std::uint64_t hash = 0xCBF2'9CE4'8422'2325ULL;
  const auto mix = [&hash](unsigned char byte) { hash = (hash ^ byte) * 0x0000'0100'0000'01B3ULL; };
  for (const Joint& joint : robot.joints) {
    for (const char c : joint.name) mix(static_cast<unsigned char>(c));
    mix(0);  // ["ab", "c"] and ["a", "bc"] differ
  }
  return hash;
}

namespace {

void add_with_weights(const std::string& path, std::vector<std::string>& files) {
  files.push_back(path);
  std::error_code unreadable;  // as who opens it: access() asks for the real user, which a policy's host is not
  for (const char* ending : {".data", "_data"})
    if (std::filesystem::exists(path + ending, unreadable)) files.push_back(path + ending);
}

// What a bundle's YAML names beside it. Where it is none, or names what is not there, its loader says so.
std::vector<std::string> named_in_bundle(const std::string& path) {
  std::vector<std::string> names;
  const auto text = read_file(path);
  if (!text) return names;
  Problems ignored(path);
  const Node root = read_document(*text, Tags::read_as_data, ignored);
  const auto add = [&](const Node* name) {
    if (name != nullptr && !name->text.empty() && name->text.find('/') == std::string::npos)
      names.push_back(name->text);
  };
  if (const Node* const models = root.find("models"))
    for (const Entry& model : models->entries)
      if (const Node* const parameters = model.value.find("parameters")) add(parameters->find("model_path"));
  if (const Node* const pipeline = root.find("pipeline")) add(pipeline->find("initial_values"));
  return names;
}

}  // namespace

std::vector<std::string> policy_files(const std::string& path) {
  std::vector<std::string> files;
  add_with_weights(path, files);
  if (!names_bundle(path)) return files;
  const std::size_t folder = path.rfind('/') == std::string::npos ? 0 : path.rfind('/') + 1;
  for (const std::string& name : named_in_bundle(path)) add_with_weights(path.substr(0, folder) + name, files);
  return files;
}

std::expected<std::uint64_t, std::string> policy_hash(const std::string& path) {
  const auto sha256 = policy_sha256(path);
  if (!sha256) return std::unexpected(sha256.error());
  return leading_64_bits(*sha256);
}

std::expected<std::string, std::string> policy_sha256(const std::string& path) {
  constexpr std::uintmax_t kLargest = std::uintmax_t{16} << 30U;  // bytes: what a robot PC can load
  const std::vector<std::string> files = policy_files(path);
  std::string first, listing;
  for (const std::string& file : files) {
    std::error_code unknown;
    if (const auto size = std::filesystem::file_size(file, unknown); !unknown && size > kLargest)
      return std::unexpected(fmt::format("policy file {}: larger than 16 GiB; check `policy.file`", file));
    const auto sha256 = file_sha256(file);
    if (!sha256) return std::unexpected(fmt::format("policy file {}: {}; check `policy.file`", file, sha256.error()));
    if (first.empty()) first = *sha256;
    listing += fmt::format("{}  {}\n", *sha256, std::filesystem::path(file).filename().string());
  }
  return files.size() == 1 ? first : sha256_hex(listing);
}

}  // namespace takt::config
