// SPDX-License-Identifier: Apache-2.0
// The network's input vector from an observation, as the robot file's terms describe it: scale, history, joint order.
//
// Shapes: input_size() values; histories oldest or newest first, laid out by term (each term's history together) or
// by time (all terms of an instant together). Each value is (scale * clipped value - mean) / standard deviation. Every
// term gains one history entry per observation, but for a sensor, which gains one per new sample, so that a slow
// camera's history holds distinct frames. After reset() the first values fill the whole history. Units: rad, rad/s, Nm,
// a sensor's own. gait_phase is the sine and the cosine of the phase, which is 0 at the first observation after
// reset(). A byte of an image is a value from 0 to 1; its values stand channel after channel or pixel after pixel, and
// of a history the images one after the other. motion_reference is left at 0 here: the network fills it itself
// (network_policy.hpp). Pure: no clock, no I/O; allocates nothing after construction. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/sensor_sample.hpp"

namespace takt::policy_host {

// One per sensor of the robot file, in its order: bytes of the image that the sample of that sensor belongs to.
using Images = std::span<const std::span<const std::uint8_t>>;

// An image that the network was shown.
struct SeenImage {
  std::size_t sensor = 0;  // index into the robot's sensors
  std::uint64_t sequence = 0;
  MonoTime sensed_at, published_at;
};

// Where in the input an image stands.
struct ImagePlace {
  std::size_t term = 0, sensor = 0;  // indices into the robot's
  std::size_t at = 0, width = 0;     // values
};

class ObservationBuilder {
 public:
  // Precondition: check_policy_section(robot) passed.
  explicit ObservationBuilder(const config::RobotConfig& robot);

  [[nodiscard]] std::size_t input_size() const { return input_size_; }
  void reset();
  // `samples`: one per sensor of the robot file, in its order; those that no term uses may be empty, and `images` where
  // no term shows any. `last_action`: raw outputs of one step. The result is valid until the next call.
  std::span<const float> build(const Observation& observation, std::span<const SensorSample> samples,
                               std::span<const float> last_action, Images images = {});

  // Every image of the input, histories included, by where it stands there; and what was there in the input built last.
  [[nodiscard]] const std::vector<ImagePlace>& image_places() const { return image_places_; }
  [[nodiscard]] std::span<const SeenImage> seen_images() const { return seen_images_; }
  // The values that an image becomes. Precondition: `place` is of image_places(), `image` as large as its sensor's,
  // `input` input_size() or more.
  void put_image(const ImagePlace& place, std::span<const std::uint8_t> image, std::span<float> input) const;

 private:
  struct Term {
    config::TermKind kind = config::TermKind::constant;
    std::size_t sensor = 0;  // index into the robot's sensors
    std::size_t width = 0;
    std::size_t history = 1;
    std::vector<std::size_t> joints;                     // terms of joints: the robot's joint of each value
    bool xyzw = false;                                   // base_orientation: w last
    float low, high;                                     // what a value is clipped to
    std::vector<float> scale, mean, standard_deviation;  // width values each, of images one per channel
    std::vector<float> constant;                         // TermKind::constant only
    double gait_period = 1;                              // s
    std::size_t channels = 0;                            // of images; 0: it shows none
    bool by_channel = false;                             // images: channel after channel
    std::vector<float> of_byte;                          // images: what each channel's 256 values become
    std::vector<float> past;                             // history * width, oldest first
    std::vector<SeenImage> seen;                         // images: history of them, oldest first
    std::uint64_t sample_seen = 0;
    MonoTime sample_published;  // a sensor's process that starts anew counts from 1 again
    bool filled = false;
  };
  [[nodiscard]] float value_of(const Term& term, std::size_t i, const Observation& observation,
                               std::span<const SensorSample> samples, std::span<const float> last_action) const;
  // `i`: of the scales.
  static float scaled(const Term& term, std::size_t i, float value);
  void read(const Term& term, const Observation& observation, std::span<const SensorSample> samples,
            std::span<const float> last_action);
  static void read_image(const Term& term, std::span<const std::uint8_t> image, std::span<float> values);
  static void remember_image(Term& term, const SensorSample& sample);
  [[nodiscard]] std::size_t from_oldest(const Term& term, std::size_t instant) const;
  [[nodiscard]] std::span<const float> instant_of(const Term& term, std::size_t instant) const;
  // Calls `visit(term's index, instant)` in the order of the input.
  template <class Visit>
  void in_order(const Visit& visit) const;
  void place_images();
  static void remember(Term& term, std::span<const float> newest);

  std::vector<Term> terms_;
  std::vector<float> home_;
  MonoTime began_at_;  // of the phase; unset: with the next observation
  bool by_time_ = false, newest_first_ = false;
  std::size_t input_size_ = 0;
  std::vector<float> newest_;  // values of the term being read
  std::vector<float> input_;
  std::vector<ImagePlace> image_places_;
  std::vector<SeenImage> seen_images_;  // one per place
};

}  // namespace takt::policy_host
