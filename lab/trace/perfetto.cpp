// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/perfetto.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

namespace takt::lab {
namespace {

// One line of the file. Spans come as a begin and an end, so that nesting is the reader's.
struct Mark {
  MonoTime at;
  int order = 0;  // at one instant: ends, then begins, then what hangs on a span that is open
  std::string json;
};
constexpr int kEnd = 0, kBegin = 1, kInside = 2;

std::string instant(MonoTime at) {
  return fmt::format("{}.{:03}", at.ns / 1000, at.ns % 1000);
}

class Marks {
 public:
  void span(std::int64_t pid, std::string_view name, MonoTime begin, MonoTime end, const std::string& arguments) {
    if (!begin.is_set() || !end.is_set() || end < begin) return;
    add(begin, kBegin, pid, 'B', fmt::format(R"("name":"{}","args":{{{}}})", name, arguments));
    add(end, kEnd, pid, 'E', fmt::format(R"("name":"{}")", name));
  }
  void counter(std::int64_t pid, std::string_view name, MonoTime at, double value) {
    add(at, kInside, pid, 'C', fmt::format(R"("name":"{}","args":{{"{}":{:.6g}}})", name, name, value));
  }
  void mode(std::int64_t pid, MonoTime at, std::string_view from, std::string_view to, std::string_view cause) {
    add(at, kInside, pid, 'i', fmt::format(R"("name":"{} -> {}","s":"g","args":{{"cause":"{}"}})", from, to, cause));
  }
  // A step of an arrow: 's' starts it, 't' passes on, 'f' ends it; each lies inside a span of its process.
  void flow(std::int64_t pid, char step, std::size_t id, MonoTime at) {
    add(at, kInside, pid, step,
        fmt::format(R"("name":"command","cat":"command","id":{}{})", id, step == 'f' ? R"(,"bp":"e")" : ""));
  }
  [[nodiscard]] std::vector<Mark> sorted() && {
    std::ranges::stable_sort(
        marks_, [](const Mark& a, const Mark& b) { return a.at != b.at ? a.at < b.at : a.order < b.order; });
    return std::move(marks_);
  }

 private:
  void add(MonoTime at, int order, std::int64_t pid, char phase, const std::string& rest) {
    marks_.push_back(
        {at, order, fmt::format(R"({{"ph":"{}","ts":{},"pid":{},"tid":{},{}}})", phase, instant(at), pid, pid, rest)});
  }
  std::vector<Mark> marks_;
};

std::string_view thread_name(std::string_view program) {
  if (program == "takt-executive") return "control";
  if (program == "takt-policy-host") return "inference";
  return program == "takt-monitor" ? "recorder" : "unknown";
}

void ticks(const TracedExecutive& executive, std::int64_t pid, Marks& marks) {
  for (const TracedTick& tick : executive.ticks) {
    const auto mode = static_cast<Mode>(tick.mode);
    marks.span(pid, "tick", tick.begin_at, tick.end_at,
               fmt::format(R"("tick":{},"mode":"{}","sequence":{})", tick.tick, name(mode), tick.sequence));
    if (tick.begin_at.is_set())
      marks.counter(pid, "wake-up, us", tick.begin_at, static_cast<double>(tick.lateness.ns) * 1e-3);
    if (tick.end_at.is_set()) marks.counter(pid, "age, ms", tick.end_at, tick.age.milliseconds());
  }
}

void answers(const Timeline& timeline, Marks& marks) {
  for (const auto& [key, same] : timeline.answers) {
    const std::string arguments = fmt::format(R"("observation_id":{},"sequence":{})", key.first, key.second);
    for (const Answer& answer : same) {
      marks.span(answer.pid, "infer", answer.infer_begin_at, answer.infer_end_at, arguments);
      marks.span(answer.pid, "publish", answer.publish_begin_at, answer.publish_end_at, arguments);
    }
  }
}

MonoTime middle(MonoTime a, MonoTime b) {
  return a + Duration{(b - a).ns / 2};
}

bool is_inside_a_tick(const TracedExecutive& executive, MonoTime at) {
  const auto after = std::ranges::upper_bound(executive.ticks, at, {}, [](const TracedTick& t) { return t.begin_at; });
  return after != executive.ticks.begin() && std::prev(after)->end_at >= at;
}

// From the tick that published the observation through inference and publishing to the tick that used the command.
// Drawn only when all four are in the trace: an arrow without an end says nothing.
void arrow(const Timeline& timeline, const TracedExecutive& executive, const CommandChain& chain, std::int64_t pid,
           std::size_t id, Marks& marks) {
  const auto observed = executive.publications.find(chain.observation_id);
  const auto same = timeline.answers.find({chain.observation_id, chain.sequence});
  if (!chain.is_whole() || observed == executive.publications.end() || same == timeline.answers.end()) return;
  const auto from = std::ranges::find(same->second, chain.host_pid, &Answer::pid);
  if (from == same->second.end() || !from->infer_begin_at.is_set() || !from->publish_begin_at.is_set()) return;
  if (!from->infer_end_at.is_set() || !from->publish_end_at.is_set()) return;
  if (!is_inside_a_tick(executive, observed->second.at) || !is_inside_a_tick(executive, chain.actuated)) return;
  marks.flow(pid, 's', id, observed->second.at);
  marks.flow(from->pid, 't', id, middle(from->infer_begin_at, from->infer_end_at));
  marks.flow(from->pid, 't', id, middle(from->publish_begin_at, from->publish_end_at));
  marks.flow(pid, 'f', id, chain.actuated);
}

std::string names_of(std::int64_t pid, std::string_view program) {
  const std::string_view shown = program.empty() ? "unknown" : program;
  return fmt::format(R"({{"ph":"M","name":"process_name","pid":{},"tid":{},"ts":0,"args":{{"name":"{}"}}}},)"
                     "\n"
                     R"({{"ph":"M","name":"thread_name","pid":{},"tid":{},"ts":0,"args":{{"name":"{}"}}}})",
                     pid, pid, shown, pid, pid, thread_name(program));
}

}  // namespace

void write_perfetto(const Timeline& timeline, const Chains& chains, std::int64_t executive_pid,
                    const std::function<void(std::string_view)>& write) {
  Marks marks;
  for (const auto& [pid, executive] : timeline.executives) ticks(executive, pid, marks);
  answers(timeline, marks);
  for (const TracedSpan& look : timeline.dequeues) marks.span(look.pid, "dequeue", look.begin_at, look.end_at, "");
  for (const TracedSpan& drain : timeline.drains) marks.span(drain.pid, "drain", drain.begin_at, drain.end_at, "");
  for (const ModeChange& change : timeline.mode_changes)
    marks.mode(executive_pid, change.now, name(static_cast<Mode>(change.previous_mode)),
               name(static_cast<Mode>(change.mode)), name(static_cast<Cause>(change.cause)));
  const TracedExecutive& executive = timeline.executives.at(executive_pid);
  for (std::size_t i = 0; i < chains.accepted.size(); ++i)
    arrow(timeline, executive, chains.accepted[i], executive_pid, i + 1, marks);

  write("{\"displayTimeUnit\":\"ns\",\"traceEvents\":[\n");
  std::string_view comma = "";
  for (const auto& [pid, process] : timeline.processes) {
    write(comma);
    write(names_of(pid, process.program));
    comma = ",\n";
  }
  for (const Mark& mark : std::move(marks).sorted()) {
    write(comma);
    write(mark.json);
    comma = ",\n";
  }
  write("\n]}\n");
}

}  // namespace takt::lab
