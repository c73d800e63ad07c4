// SPDX-License-Identifier: Apache-2.0
// What mutants_test.py mutates: one of everything that is found, and of what must be left alone.
#include <array>
#include <compare>
#include <cstdio>

namespace {

constexpr int kTable = 3 * 2;  // a constant stays one

struct Instant {
  int ns = 0;
  friend auto operator<=>(const Instant&, const Instant&) = default;
};

constexpr bool is_old(Instant age, Instant most) {
  return age > most;  // at run time a mutant, in a static_assert never
}
static_assert(is_old({3}, {2}) && !is_old({2}, {2}));

struct Joint {
  int torque = 0;
  void push(int by) { torque += by; }
};

int total(const std::array<int, 3>& values) {
  int sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values[i] != 2 && (values[i] < 7 || kTable == 0)) sum += values[i];
  return sum;
}

int named(int mode) {
  switch (mode) {
    case 4:
      return 1 + 1;
  }
  return 0;
}

}  // namespace

int main(int argc, char**) {
  Joint joint;
  joint.push(5);
  const bool old = is_old({argc + 1}, {2});
  std::printf("%d %d %d %d\n", joint.torque, old, total({1, 2, 4}), named(4));
}
