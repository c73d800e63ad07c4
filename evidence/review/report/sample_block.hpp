// SPDX-License-Identifier: Apache-2.0
// Samples of a run over buckets of consecutive ticks, thinned out so that no spike is lost: a column keeps a bucket's
// smallest value and how far the largest lies above it, or the one value that counts.
//
// Columns are made once from the robot's file, in this order; "@" stands for a joint's or bus's number, from 0:
//   age, age.spread              ms        of the command in use
//   sense queue infer publish hold  ms     its parts where the bucket's command was oldest
//   interventions                mask      every kind that acted in the bucket, on any joint
//   (contract/intervention.hpp) lateness, work               us        the largest bus@.state BusState  the worst
//   bus@.errors                  frames    dropped or foreign, within the bucket
//   q@, q@.spread, reference@, reference@.spread  rad
//   target@                      rad       last step of the policy's chunk in use: where it wants the joint to go
//   dq@, tau@                    rad/s, Nm estimated speed, torque that the drive reports: the largest, with its sign
//   temperature@                 deg C     the highest that the drive reports; 0: it reports none
//   kp@, kd@                     Nm/rad, Nm s/rad  told to the drive in the bucket's last tick
//   task.x task.y task.z         m         the task's target, when it is known
// A value that does not exist is NaN. Memory: four bytes per value. Thread rule: one thread.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::evidence {

struct SampleColumn {
  std::string name;
  bool whole = false;  // holds integers of up to 15 bits
  std::vector<float> values;
};

struct SampleBlock {
  std::uint64_t bucket_ticks = 1;
  std::vector<double> at_s;  // first tick of each bucket, since the run's first tick
  std::vector<SampleColumn> columns;
  [[nodiscard]] std::size_t rows() const { return at_s.size(); }
};

// What belongs to a tick beside its record.
struct TickContext {
  std::span<const float> policy_target;        // rad, one per joint; empty: no command yet
  std::optional<config::Vector3> task_target;  // m
};

class SampleBlockBuilder {
 public:
  SampleBlockBuilder(std::size_t joints, std::size_t buses, bool has_task_target, std::uint64_t bucket_ticks,
                     Duration period);

  // Ticks in order, `at_s` since the run's first tick. Where tick numbers are missing lies a row of nothing but NaN, a
  // period behind the last tick before: what was known until then does not reach over the gap.
  void tick(const TickRecord& record, double at_s, const TickContext& context);
  // The ticks up to the next one given are left out on purpose: they are no gap.
  void pause();
  SampleBlock finish();

  // Bytes of a row as it is stored.
  static std::size_t row_bytes(std::size_t joints, std::size_t buses, bool has_task_target);

 private:
  struct Extremes {
    float least = 0, most = 0;
    bool empty = true;
    void add(float value);
  };
  struct Strain {
    float dq = 0, tau = 0, temperature = 0, kp = 0, kd = 0;
    void add(const JointRecord& joint);
  };
  struct Bucket {
    double at_s = 0;
    std::uint64_t ticks = 0;
    Extremes age;
    AgeParts oldest;
    unsigned interventions = 0;
    float lateness_us = 0, work_us = 0;
    std::vector<unsigned> bus_state;
    std::vector<std::uint32_t> bus_errors;
    std::vector<Extremes> q, reference;
    std::vector<Strain> strain;
    std::vector<float> policy_target;
    std::optional<config::Vector3> task_target;
  };

  void begin(double at_s, const TickContext& context);
  void take(const TickRecord& record);
  void take_buses(const TickRecordHeader& header);
  void flush();
  void put(float value);
  void put(const Extremes& extremes);
  void put_gap(double at_s);

  std::size_t joints_, buses_;
  bool has_task_target_;
  double period_s_;
  SampleBlock block_;
  Bucket bucket_;
  std::vector<std::uint32_t> errors_before_;
  std::uint64_t last_tick_ = 0;  // 0: none that the next could follow
  double last_at_s_ = 0;
  std::size_t column_ = 0;  // that put() fills next
};

}  // namespace takt::evidence
