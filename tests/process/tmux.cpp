// SPDX-License-Identifier: Apache-2.0
#include "tests/process/tmux.hpp"

#include <array>
#include <chrono>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <thread>

namespace takt::test {
namespace {

constexpr auto kPollEvery = std::chrono::milliseconds(50);
constexpr int kPolls = 600;

bool poll_until(const auto& holds) {
  for (int poll = 0; poll < kPolls && !holds(); ++poll) std::this_thread::sleep_for(kPollEvery);
  return holds();
}

}  // namespace

std::string output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen((command + " 2>&1").c_str(), "r"), pclose);
  std::string all;
  std::array<char, 4096> part{};
  while (const std::size_t size = fread(part.data(), 1, part.size(), pipe.get())) all.append(part.data(), size);
  return all;
}

bool has_tmux() {
  return output_of("tmux -V").starts_with("tmux ");
}

Tmux::Tmux(const std::string& directory, const std::string& path_first) : socket_(directory + "/tmux.sock") {
  const std::string said =
      tmux("-u -f /dev/null new-session -d -x 80 -y 24 \"env LC_ALL=C.UTF-8 PS1='shell> ' PATH=" + path_first +
           ":$PATH sh -i\"");
  if (!said.empty()) throw std::runtime_error("tmux: " + said);
}

Tmux::~Tmux() {
  (void)tmux("kill-server");
}

std::string Tmux::tmux(const std::string& command) const {
  return output_of("tmux -S " + socket_ + " " + command);
}

void Tmux::type(const std::string& line) const {
  (void)tmux("send-keys -l '" + line + "'");
  press("Enter");
}

void Tmux::press(const std::string& keys) const {
  (void)tmux("send-keys " + keys);
}

void Tmux::resize(int columns, int rows) const {
  (void)tmux("resize-window -x " + std::to_string(columns) + " -y " + std::to_string(rows));
}

std::string Tmux::screen() const {
  return tmux("capture-pane -p");
}

bool Tmux::shows(const std::string& text) const {
  return poll_until([&] { return screen().find(text) != std::string::npos; });
}

bool Tmux::hides(const std::string& text) const {
  return poll_until([&] { return screen().find(text) == std::string::npos; });
}

std::string Tmux::ask(const std::string& format) const {
  const std::string said = tmux("display-message -p '" + format + "'");
  return said.substr(0, said.find('\n'));
}

}  // namespace takt::test
