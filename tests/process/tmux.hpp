// SPDX-License-Identifier: Apache-2.0
// A terminal without a viewer: a tmux server of a test's own with one window, whose screen can be read and whose
// keyboard can be pressed. Everything in it is gone with the object. Waits are bounded polls for what the screen says.
#pragma once

#include <string>

namespace takt::test {

// Of a shell command; stdout and stderr together.
std::string output_of(const std::string& command);
bool has_tmux();

class Tmux {
 public:
  // An interactive shell, 80 x 24, UTF-8. `directory`: for the server's socket; `path_first`: before PATH.
  Tmux(const std::string& directory, const std::string& path_first);
  ~Tmux();
  Tmux(const Tmux&) = delete;
  Tmux& operator=(const Tmux&) = delete;

  void type(const std::string& line) const;   // and Enter
  void press(const std::string& keys) const;  // tmux's names: a, C-z, Down
  void resize(int columns, int rows) const;
  [[nodiscard]] std::string screen() const;
  // False: it never said so within 30 s.
  [[nodiscard]] bool shows(const std::string& text) const;
  [[nodiscard]] bool hides(const std::string& text) const;
  // tmux's own knowledge of the window, such as "#{alternate_on}".
  [[nodiscard]] std::string ask(const std::string& format) const;

 private:
  [[nodiscard]] std::string tmux(const std::string& command) const;
  std::string socket_;
};

}  // namespace takt::test
