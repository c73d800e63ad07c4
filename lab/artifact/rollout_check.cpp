// SPDX-License-Identifier: Apache-2.0
// What a row must satisfy before it is written and after it was read.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "lab/artifact/rollout_fields.hpp"
#include "monitor/judge/fault_classifier.hpp"

namespace takt::lab {
namespace {

bool all_of(std::string_view text, bool (*allowed)(char)) {
  return std::ranges::all_of(text, allowed);
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_lower(char c) {
  return c >= 'a' && c <= 'z';
}
bool is_hex(char c) {
  return is_digit(c) || (c >= 'a' && c <= 'f');
}
bool is_label(char c) {
  return is_lower(c) || is_digit(c) || c == '_';
}
bool is_token(char c) {
  return is_label(c) || c == '-' || c == '.';
}
bool is_graphic(char c) {
  return c > ' ' && c <= '~';
}
bool is_printable(char c) {
  return c >= ' ' && c <= '~';
}

constexpr std::size_t kSha256Digits = 64;

struct Checker {
  const RolloutField& field;
  std::string reason;  // empty: fine

  void number(double value) {
    if (!std::isfinite(value)) {
      reason = fmt::format("{} is not finite", field.name);
    } else if (value < field.range.low || value > field.range.high) {
      reason = fmt::format("{} is {}, outside {}", field.name, value, range_text());
    }
  }
  void operator()(const bool* /*place*/) {}
  void operator()(const std::uint64_t* place) {
    if (*place > kLargestCount) reason = fmt::format("{} is {}, above 2^53 - 1", field.name, *place);
  }
  void operator()(const double* place) { number(*place); }
  void operator()(const std::optional<double>* place) {
    if (place->has_value()) number(**place);
  }
  void operator()(const std::string* place) {
    if (!matches(field.format, *place)) {
      reason = fmt::format("{} is \"{}\", not {}", field.name, *place, pattern_of(field.format));
    }
  }
  void operator()(const Mode* place) {
    if (static_cast<std::size_t>(*place) >= kModeCount) reason = fmt::format("{} is no mode", field.name);
  }
  void operator()(const Cause* place) {
    if (static_cast<std::size_t>(*place) >= kCauseCount) reason = fmt::format("{} is no cause", field.name);
  }
  [[nodiscard]] std::string range_text() const {
    if (field.range.high == std::numeric_limits<double>::max()) return fmt::format("{} or more", field.range.low);
    return fmt::format("{}..{}", field.range.low, field.range.high);
  }
};

constexpr double kRounding = 1e-9;

struct NamedAge {
  std::string name;
  const evidence::AgeQuantiles* age;
};

std::string disorder(const NamedAge& one) {
  const auto& [p50, p95, p99] = *one.age;
  if (p50.has_value() != p95.has_value() || p50.has_value() != p99.has_value())
    return fmt::format("{} has some of its quantiles", one.name);
  if (p50 && (*p50 > *p95 || *p95 > *p99))
    return fmt::format("{} has p50 {}, p95 {}, p99 {} ms, which do not rise", one.name, *p50, *p95, *p99);
  return {};
}

// How far beyond the largest of at least so many samples their p-quantile may lie, as a share of it: the exclusive
// definition goes on in a straight line.
double beyond_largest(double p, std::uint64_t samples) {
  const auto n = static_cast<double>(samples);
  return samples < 2 ? 1 : std::max(0.0, p * (n + 1) - n);
}

// A part is no larger than its whole in any sample, so in no quantile either that lies among them.
std::string beyond_total(const NamedAge& part, const evidence::AgeQuantiles& total, std::uint64_t samples) {
  struct OfAge {
    const char* name;
    std::optional<double> evidence::AgeQuantiles::*quantile;
    double p;
  };
  for (const auto& [name, of, p] :
       {OfAge{"p50", &evidence::AgeQuantiles::p50_ms, 0.5}, OfAge{"p95", &evidence::AgeQuantiles::p95_ms, 0.95},
        OfAge{"p99", &evidence::AgeQuantiles::p99_ms, 0.99}}) {
    const auto &value = (*part.age).*of, &whole = total.*of;
    if (value.has_value() != whole.has_value()) return fmt::format("{} has samples that its total has not", part.name);
    if (value && *value > *whole * (1 + beyond_largest(p, samples)) + 1e-6)
      return fmt::format("{}.{} is {} ms, more than the total's {}", part.name, name, *value, *whole);
  }
  return {};
}

// `samples`: at least so many.
std::string inconsistency(const std::string& name, const evidence::AgeRow& age, std::uint64_t samples) {
  const NamedAge total{name + ".total", &age.total};
  if (std::string reason = disorder(total); !reason.empty()) return reason;
  for (const NamedAge& part : {NamedAge{name + ".sense", &age.sense}, NamedAge{name + ".queue", &age.queue},
                               NamedAge{name + ".infer", &age.infer}, NamedAge{name + ".publish", &age.publish},
                               NamedAge{name + ".hold", &age.hold}}) {
    if (std::string reason = disorder(part); !reason.empty()) return reason;
    if (std::string reason = beyond_total(part, age.total, samples); !reason.empty()) return reason;
  }
  return {};
}

std::string inconsistency(const char* name, const evidence::MissRow& misses) {
  if (misses.misses > misses.count) return fmt::format("{}.misses is {} of only {}", name, misses.misses, misses.count);
  const double rate = misses.count == 0 ? 0 : static_cast<double>(misses.misses) / static_cast<double>(misses.count);
  if (std::abs(misses.rate - rate) > kRounding)
    return fmt::format("{}.rate is {}, and {} of {} are {}", name, misses.rate, misses.misses, misses.count, rate);
  const auto count = static_cast<double>(misses.count);
  if (!(misses.effective_count >= std::min(count, 1.0) && misses.effective_count <= count))
    return fmt::format("{}.effective_count is {}, of {}", name, misses.effective_count, misses.count);
  if (misses.upper_bound + kRounding < rate)
    return fmt::format("{}.upper_bound is {}, below the rate {}", name, misses.upper_bound, rate);
  return {};
}

std::string inconsistency_of_shares(const evidence::RolloutRow& row) {
  const auto there = std::ranges::count_if(row.fault_shares, [](const auto& share) { return share.has_value(); });
  if (there == 0) return {};
  if (there != monitor::kFaultCount) return fmt::format("has {} of {} faults.shares", there, monitor::kFaultCount);
  double sum = 0;
  for (const auto& share : row.fault_shares) sum += *share;
  const double wanted = row.fault_verdicts == 0 ? 0 : 1;
  return std::abs(sum - wanted) <= kRounding ? "" : fmt::format("faults.shares add up to {}, not to {}", sum, wanted);
}

std::string inconsistency(const evidence::RolloutRow& row) {
  if (row.success && !row.failure_label.empty()) return "failure_label is set on a success";
  if (!row.success && row.failure_label.empty()) return "failure_label is empty on a failure";
  if (row.success && row.final_mode == Mode::fault_latched) return "is a success that ended in fault_latched";
  if (row.success && row.fell) return "is a success that fell";
  if (row.leading_fault.empty() != (row.fault_verdicts == 0)) {
    return fmt::format("faults.leading is \"{}\" with {} verdicts", row.leading_fault, row.fault_verdicts);
  }
  if (std::string reason = inconsistency_of_shares(row); !reason.empty()) return reason;
  for (const auto& [name, misses] :
       {std::pair{"misses_per_command", row.misses_per_command}, std::pair{"misses_per_tick", row.misses_per_tick}})
    if (std::string reason = inconsistency(name, misses); !reason.empty()) return reason;
  // What was not missed has an age.
  const auto aged = [](const evidence::MissRow& misses) { return misses.count - misses.misses; };
  if (std::string reason = inconsistency("age_per_command", row.age_per_command, aged(row.misses_per_command));
      !reason.empty())
    return reason;
  if (std::string reason = inconsistency("age_per_tick", row.age_per_tick, aged(row.misses_per_tick)); !reason.empty())
    return reason;
  double shares = 0;
  for (const double share : row.mode_share) shares += share;
  if (row.ticks > 0 && std::abs(shares - 1) > 1e-6) return fmt::format("mode_share adds up to {}, not to 1", shares);
  if (row.ticks > 0 && row.mode_share[static_cast<std::size_t>(row.final_mode)] == 0)
    return fmt::format("ended in {}, where it spent none of its ticks", name(row.final_mode));
  if (row.misses_per_tick.count > row.ticks)
    return fmt::format("misses_per_tick.count is {} of only {} ticks", row.misses_per_tick.count, row.ticks);
  return {};
}

}  // namespace

bool matches(TextFormat format, std::string_view text) {
  switch (format) {
    case TextFormat::schema:
      return text == evidence::kRolloutSchema;
    case TextFormat::token:
      return !text.empty() && !text.starts_with('.') && all_of(text, is_token);
    case TextFormat::label:
      return all_of(text, is_label);
    case TextFormat::fault:
      return text.empty() || std::ranges::find(monitor::kFaultNames, text) != monitor::kFaultNames.end();
    case TextFormat::sha256:
      return text.size() == kSha256Digits && all_of(text, is_hex);
    case TextFormat::optional_sha256:
      return text.empty() || (text.size() == kSha256Digits && all_of(text, is_hex));
    case TextFormat::hex:
      return all_of(text, is_hex);
    case TextFormat::version:
      return !text.empty() && all_of(text, is_graphic);
    case TextFormat::path:
      return all_of(text, is_printable) && !text.starts_with('/') && text.find("..") == std::string_view::npos;
  }
  return false;
}

std::string_view pattern_of(TextFormat format) {
  switch (format) {
    case TextFormat::schema:
      return "^takt\\.rollout/1$";
    case TextFormat::token:
      return "^[a-z0-9_-][a-z0-9_.-]*$";
    case TextFormat::label:
      return "^[a-z0-9_]*$";
    case TextFormat::fault: {
      static const std::string kPattern = fmt::format("^({})?$", fmt::join(monitor::kFaultNames, "|"));
      return kPattern;
    }
    case TextFormat::sha256:
      return "^[0-9a-f]{64}$";
    case TextFormat::optional_sha256:
      return "^([0-9a-f]{64})?$";
    case TextFormat::hex:
      return "^[0-9a-f]*$";
    case TextFormat::version:
      return "^[!-~]+$";
    case TextFormat::path:
      return "^(?!/)(?!.*\\.\\.)[ -~]*$";
  }
  return "";
}

std::expected<void, std::string> check(const evidence::RolloutRow& row) {
  for (const RolloutField& field : rollout_fields()) {
    Checker checker{field, {}};
    std::visit(checker, place_in(field, row));
    if (!checker.reason.empty()) return std::unexpected(checker.reason);
  }
  if (std::string reason = inconsistency(row); !reason.empty()) return std::unexpected(std::move(reason));
  return {};
}

}  // namespace takt::lab
