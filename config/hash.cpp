#include "config/hash.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>

#include "config/bundle_name.hpp"
#include "config/document.hpp"
#include "config/load.hpp"

namespace takt::config {
namespace {

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) { EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr); }
  void add(const void* data, std::size_t size) { EVP_DigestUpdate(context_.get(), data, size); }
  std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string text;
    for (unsigned int i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

// Empty: added. Else why it cannot be read.
std::string add_file(Sha256& sha, const std::string& path) {
  // Without waiting for whoever writes a FIFO.
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat status {};
  if (fd < 0 || fstat(fd, &status) != 0) return std::strerror(errno);
  if (!S_ISREG(status.st_mode)) {
    close(fd);
    return "is not a regular file";
  }
  std::array<char, 65536> buffer{};
  ssize_t got = 0;
  while ((got = read(fd, buffer.data(), buffer.size())) > 0) sha.add(buffer.data(), static_cast<std::size_t>(got));
  std::string why = got == 0 ? "" : std::strerror(errno);
  close(fd);
  return why;
}

}  // namespace

std::string sha256_hex(std::string_view bytes) {
  Sha256 sha;
  sha.add(bytes.data(), bytes.size());
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
  for (const char* ending : {".data", "_data"}) {
    if (access((path + ending).c_str(), F_OK) == 0) files.push_back(path + ending);
  }
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
  Sha256 sha;
  for (const std::string& file : policy_files(path)) {
    if (const std::string why = add_file(sha, file); !why.empty())
      return std::unexpected(fmt::format("policy file {}: {}; check `policy.file`", file, why));
  }
  return leading_64_bits(sha.hex());
}

}  // namespace takt::config
