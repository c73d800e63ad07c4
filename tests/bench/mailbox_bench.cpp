// SPDX-License-Identifier: Apache-2.0
// takt-bench-mailbox: what the mailbox costs, as multiples of the machine's own floor (one cache line passed between
// two cores) and of other transports, all measured in one run, interleaved, medians over repetitions. Bounded: about 30
// s.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>

#include "tests/bench/bench.hpp"
#include "tests/bench/mailbox_figures.hpp"
#include "tests/bench/round_trip.hpp"

namespace takt::bench {
namespace {

constexpr std::array<std::size_t, 3> kSizes{256, 512, 1024};
constexpr std::array<double, 3> kMostLines{3.3, 4.0, 5.5};  // target: publish -> observe p50, in line transfers
constexpr double kMostHammeredSpread = 1.6;                 // target: hammered p99 / p50
constexpr double kMostPushP99 = 1000.0;                     // target: ns
constexpr int kKilledWriters = 400;

// Figures of the same thing over repetitions.
struct Series {
  std::vector<double> p50;
  std::vector<double> p99;
  void add(const Spread& spread) {
    p50.push_back(spread.p50);
    p99.push_back(spread.p99);
  }
};

struct Peer {
  const char* absent_text;
  double most;  // target: our half round trip / theirs
  std::unique_ptr<RoundTrip> round_trip;
  std::vector<double> half{};
};

struct Results {
  std::vector<double> line;
  std::array<Series, kSizes.size()> observe;
  std::array<std::vector<double>, kSizes.size()> lines;  // per repetition: observe p50 / line
  Series hammered;
  Series write;
  Series read;
  Series push;
  std::vector<double> own_half;
  int worst_tries = 0;
  std::uint64_t gave_up = 0;
  std::uint64_t hammered_reads = 0;
  std::uint64_t torn = 0;
};

const char* verdict(bool reached) {
  return reached ? "reached" : "MISSED";
}

std::vector<Peer> connect_peers([[maybe_unused]] const TwoCpus& cpus) {
  std::vector<Peer> peers;
  peers.push_back({"iceoryx", 0.25, nullptr});
  peers.push_back({"Cyclone DDS", 0.03, nullptr});
#if defined(TAKT_BENCH_ICEORYX)
  peers[0].round_trip = iceoryx_round_trip(cpus);
#endif
#if defined(TAKT_BENCH_CYCLONE)
  peers[1].round_trip = cyclone_round_trip(cpus);
#endif
  return peers;
}

void repeat(Results& results, RoundTrip& own, std::vector<Peer>& peers, const TwoCpus& cpus) {
  // A virtual machine's processors move between cores that are near or far: the floor is measured on either side.
  double before = line_transfer(cpus);
  for (std::size_t i = 0; i < kSizes.size(); ++i) {
    const Observed observed = publish_to_observe(cpus, kSizes[i]);
    const double after = line_transfer(cpus);
    results.line.push_back(after);
    results.observe[i].add(observed.latency);
    results.lines[i].push_back(observed.latency.p50 / (0.5 * (before + after)));
    results.torn += observed.torn;
    before = after;
  }
  const HammeredRead hammered = hammered_read(cpus);
  results.hammered.add(hammered.latency);
  results.worst_tries = std::max(results.worst_tries, hammered.worst_tries);
  results.gave_up += hammered.gave_up;
  results.hammered_reads += hammered.reads;
  results.torn += hammered.torn;
  const SameCore same_core = uncontended(cpus[1]);
  results.write.add(same_core.write);
  results.read.add(same_core.read);
  results.push.add(record_push(cpus[1]));
  if (const auto half = own.measure()) results.own_half.push_back(*half);
  for (Peer& peer : peers) {
    if (!peer.round_trip) continue;
    if (const auto half = peer.round_trip->measure()) peer.half.push_back(*half);
  }
}

void report_latencies(const Report& report, const Results& results) {
  const double line = median(results.line);
  report.figure(fmt::format("one cache line, one way               p50 {:7.0f} ns", line),
                {{"bench", "mailbox"}, {"row", "line_transfer"}, {"p50_ns", line}});
  for (std::size_t i = 0; i < kSizes.size(); ++i) {
    const double p50 = median(results.observe[i].p50);
    const double p99 = median(results.observe[i].p99);
    const double lines = median(results.lines[i]);
    const bool reached = lines <= kMostLines[i];
    report.figure(fmt::format("publish -> observe, {:4} B             p50 {:7.0f} ns  p99 {:7.0f} ns  = {:.2f} lines "
                              "(<= {:.1f}: {})",
                              kSizes[i], p50, p99, lines, kMostLines[i], verdict(reached)),
                  {{"bench", "mailbox"},
                   {"row", "publish_to_observe"},
                   {"bytes", kSizes[i]},
                   {"p50_ns", p50},
                   {"p99_ns", p99},
                   {"line_transfers", lines},
                   {"target", kMostLines[i]},
                   {"reached", reached}});
  }
  const auto same_core = [&](const char* text, const char* row, const Series& series) {
    report.figure(fmt::format("{:<37} p50 {:7.0f} ns  p99 {:7.0f} ns", text, median(series.p50), median(series.p99)),
                  {{"bench", "mailbox"}, {"row", row}, {"p50_ns", median(series.p50)}, {"p99_ns", median(series.p99)}});
  };
  same_core("write, 512 B, hot, same core", "write_uncontended", results.write);
  same_core("read, 512 B, hot, same core", "read_uncontended", results.read);
  const double push_p99 = median(results.push.p99);
  report.figure(fmt::format("record push, 12 joints, at 1 kHz      p50 {:7.0f} ns  p99 {:7.0f} ns  (<= {:.0f}: {})",
                            median(results.push.p50), push_p99, kMostPushP99, verdict(push_p99 <= kMostPushP99)),
                {{"bench", "mailbox"},
                 {"row", "record_push"},
                 {"joints", 12},
                 {"p50_ns", median(results.push.p50)},
                 {"p99_ns", push_p99},
                 {"target", kMostPushP99},
                 {"reached", push_p99 <= kMostPushP99}});
}

void report_robustness(const Report& report, const Results& results, const TwoCpus& cpus) {
  const double p50 = median(results.hammered.p50);
  const double p99 = median(results.hammered.p99);
  const bool steady = p99 <= kMostHammeredSpread * p50 && results.worst_tries <= 4;
  report.figure(
      fmt::format(
          "read, 512 B, hammering writer         p50 {:7.0f} ns  p99 {:7.0f} ns  = {:.2f} x p50, worst {} tries, "
          "gave up {} of {} (<= {:.1f} x, <= 4 tries: {})",
          p50, p99, p99 / p50, results.worst_tries, results.gave_up, results.hammered_reads, kMostHammeredSpread,
          verdict(steady)),
      {{"bench", "mailbox"},
       {"row", "read_hammered"},
       {"p50_ns", p50},
       {"p99_ns", p99},
       {"worst_tries", results.worst_tries},
       {"gave_up", results.gave_up},
       {"reads", results.hammered_reads},
       {"reached", steady}});
  report.figure(
      fmt::format("torn or falsely refused payloads      {} (0: {})", results.torn, verdict(results.torn == 0)),
      {{"bench", "mailbox"}, {"row", "torn"}, {"count", results.torn}, {"reached", results.torn == 0}});
  const int readable = readable_after_kill(cpus, kKilledWriters);
  report.figure(fmt::format("readable after SIGKILL of the writer  {} of {} (all: {})", readable, kKilledWriters,
                            verdict(readable == kKilledWriters)),
                {{"bench", "mailbox"},
                 {"row", "readable_after_kill"},
                 {"count", readable},
                 {"of", kKilledWriters},
                 {"reached", readable == kKilledWriters}});
}

void report_peers(const Report& report, const Results& results, const std::vector<Peer>& peers) {
  const double own = median(results.own_half);
  report.figure(
      fmt::format("round trip / 2, 512 B: takt mailbox   p50 {:7.0f} ns", own),
      {{"bench", "mailbox"}, {"row", "round_trip"}, {"transport", "takt mailbox, polled"}, {"half_p50_ns", own}});
  for (const Peer& peer : peers) {
    if (!peer.round_trip) {
      report.figure(
          fmt::format("round trip / 2, 512 B: {}: not installed when this was built", peer.absent_text),
          {{"bench", "mailbox"}, {"row", "round_trip"}, {"transport", peer.absent_text}, {"installed", false}});
      continue;
    }
    const double theirs = median(peer.half);  // NaN, and null in JSON, when it never answered
    const bool reached = own / theirs <= peer.most;
    report.figure(fmt::format("round trip / 2, 512 B: {:<27} p50 {:7.0f} ns; ours is {:.3f} x (<= {:.2f}: {})",
                              peer.round_trip->name(), theirs, own / theirs, peer.most, verdict(reached)),
                  {{"bench", "mailbox"},
                   {"row", "round_trip"},
                   {"transport", peer.round_trip->name()},
                   {"half_p50_ns", theirs},
                   {"ours_relative", own / theirs},
                   {"target", peer.most},
                   {"reached", reached}});
  }
}

int run(bool as_json, int repetitions) {
  const std::vector<int> allowed = allowed_cpus();
  if (allowed.size() < 2) {
    fmt::print(stderr, "takt-bench-mailbox: needs two processors, may use {}: widen its affinity\n", allowed.size());
    return 71;
  }
  const TwoCpus cpus{allowed[0], allowed[1]};
  const Report report(as_json);
  if (const Pinned probe(cpus[0]); !probe.is_realtime()) {
    report.remark("WARNING: no right to SCHED_FIFO: figures are those of an ordinary process (run as root)");
  }
  ns_per_tick();
  const std::unique_ptr<RoundTrip> own = mailbox_round_trip(cpus);
  std::vector<Peer> peers = connect_peers(cpus);
  Results results;
  for (int i = 0; i < repetitions; ++i) repeat(results, *own, peers, cpus);
  report.remark(
      fmt::format("processors {} and {}, medians of {} interleaved repetitions", cpus[0], cpus[1], repetitions));
  report_latencies(report, results);
  report_robustness(report, results, cpus);
  report_peers(report, results, peers);
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app("What Takt's mailbox costs, beside one cache line transfer, iceoryx and Cyclone DDS");
  bool as_json = false;
  int repetitions = 7;
  app.add_flag("--json", as_json, "One JSON object per figure");
  app.add_option("--repetitions", repetitions, "Medians are taken over this many")->check(CLI::Range(1, 50));
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(as_json, repetitions);
}
