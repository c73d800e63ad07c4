// SPDX-License-Identifier: Apache-2.0
#include "lab/data_set/lerobot_data_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "config/action_target.hpp"
#include "lab/artifact/parquet_file.hpp"
#include "lab/data_set/feature_statistics.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::data_set {
namespace {

using Json = nlohmann::ordered_json;
using lab::parquet_file;
using lab::ParquetColumn;
using lab::ParquetRowGroup;
using lab::ParquetShape;
using lab::ParquetType;

constexpr std::int64_t kFilesPerChunk = 1000;
constexpr std::int64_t kTaskIndex = 0;

struct Feature {
  std::string name;
  ParquetType type;
  std::vector<std::string> names{}, units{};  // of each value; none: it is one number
  [[nodiscard]] std::size_t width() const { return std::max<std::size_t>(names.size(), 1); }
};
// Of one episode: frames x width of each feature.
using FeatureValues = std::vector<std::vector<double>>;

std::string_view suffix_of(config::ActionKind kind) {
  switch (kind) {
    case config::ActionKind::joint_position:
      return ".pos";
    case config::ActionKind::joint_velocity:
      return ".vel";
    case config::ActionKind::joint_torque:
      return ".torque";
  }
  return {};
}

void name_values(Feature& feature, const Robot& robot, const std::vector<std::string>& joints,
                 config::ActionKind kind) {
  for (const std::string& joint : joints) {
    feature.names.push_back(joint + std::string(suffix_of(kind)));
    const bool slides = std::ranges::find(robot.slides, joint) != robot.slides.end();
    feature.units.emplace_back(
        config::target_of(kind).quantity.unit(slides ? config::JointKind::slide : config::JointKind::hinge));
  }
}

std::vector<Feature> features_of(const Robot& robot) {
  Feature state{"observation.state", ParquetType::float32};
  name_values(state, robot, robot.joints, config::ActionKind::joint_position);
  name_values(state, robot, robot.joints, config::ActionKind::joint_velocity);
  Feature action{"action", ParquetType::float32};
  name_values(action, robot, robot.acting_joints, robot.action);
  return {std::move(state),
          std::move(action),
          {"timestamp", ParquetType::float32},
          {"frame_index", ParquetType::int64},
          {"episode_index", ParquetType::int64},
          {"index", ParquetType::int64},
          {"task_index", ParquetType::int64}};
}

// Where an episode lies in the data set.
struct Place {
  std::int64_t episode = 0;
  std::int64_t first_index = 0;  // of its first frame
  std::int64_t file = 0;
};

// In the order of features_of().
FeatureValues values_of(const Episode& episode, const Place& place, std::int64_t fps) {
  FeatureValues values(7);
  values[0].assign(episode.states.begin(), episode.states.end());
  values[1].assign(episode.actions.begin(), episode.actions.end());
  for (std::size_t frame = 0; frame < episode.frames; ++frame) {
    const auto number = static_cast<double>(frame);
    values[2].push_back(static_cast<float>(number / static_cast<double>(fps)));
    values[3].push_back(number);
    values[4].push_back(static_cast<double>(place.episode));
    values[5].push_back(static_cast<double>(place.first_index) + number);
    values[6].push_back(static_cast<double>(kTaskIndex));
  }
  return values;
}

void add_value(ParquetColumn& column, double value) {
  if (column.type() == ParquetType::int64) return column.add(static_cast<std::int64_t>(value));
  column.add(static_cast<float>(value));
}

ParquetRowGroup row_group_of(const std::vector<Feature>& features, const FeatureValues& values) {
  ParquetRowGroup columns;
  for (std::size_t each = 0; each < features.size(); ++each) {
    const std::size_t width = features[each].width();
    const ParquetShape shape = width > 1 ? ParquetShape::list : ParquetShape::required;
    ParquetColumn& column = columns.emplace_back(features[each].name, features[each].type, shape);
    for (std::size_t at = 0; at < values[each].size(); ++at) {
      if (width > 1 && at % width == 0) column.begin_list();
      add_value(column, values[each][at]);
    }
  }
  return columns;
}

std::size_t bytes_of(const ParquetRowGroup& columns) {
  std::size_t bytes = 0;
  for (const ParquetColumn& column : columns)
    bytes += column.entries() * (column.type() == ParquetType::float32 ? 4 : 8);
  return bytes;
}

struct NamedStatistic {
  std::string name;
  std::vector<double> values;
};

std::vector<NamedStatistic> named(const FeatureStatistics& of) {
  std::vector<NamedStatistic> all{{"min", of.min}, {"max", of.max}, {"mean", of.mean}, {"std", of.std}};
  for (std::size_t each = 0; each < kQuantiles.size(); ++each)
    all.push_back({fmt::format("q{:02.0f}", 100 * kQuantiles[each]), of.quantiles[each]});
  return all;
}

ParquetColumn column_of(const std::string& name, std::span<const std::int64_t> values) {
  ParquetColumn column(name, ParquetType::int64, ParquetShape::required);
  for (const std::int64_t value : values) column.add(value);
  return column;
}

// The rows of meta/episodes, as they come.
class EpisodeTable {
 public:
  explicit EpisodeTable(const std::vector<Feature>& features) : features_(features) {}
  void add(const Episode& episode, const Place& place, const FeatureValues& values) {
    const auto frames = static_cast<std::int64_t>(episode.frames);
    episode_.push_back(place.episode);
    length_.push_back(frames);
    chunk_.push_back(place.file / kFilesPerChunk);
    file_.push_back(place.file % kFilesPerChunk);
    from_.push_back(place.first_index);
    to_.push_back(place.first_index + frames);
    for (std::size_t each = 0; each < features_.size(); ++each) add_statistics(each, values[each]);
  }
  [[nodiscard]] std::string file(const std::string& task) const {
    ParquetColumn tasks("tasks", ParquetType::text, ParquetShape::list);
    for (std::size_t row = 0; row < episode_.size(); ++row) {
      tasks.begin_list();
      tasks.add(std::string_view(task));
    }
    const std::vector<std::int64_t> none(episode_.size(), 0);
    ParquetRowGroup columns{column_of("episode_index", episode_), std::move(tasks),
                            column_of("length", length_),         column_of("data/chunk_index", chunk_),
                            column_of("data/file_index", file_),  column_of("dataset_from_index", from_),
                            column_of("dataset_to_index", to_)};
    columns.insert(columns.end(), statistics_.begin(), statistics_.end());
    columns.push_back(column_of("meta/episodes/chunk_index", none));
    columns.push_back(column_of("meta/episodes/file_index", none));
    return parquet_file("episodes", {&columns, 1}, {});
  }

 private:
  ParquetColumn& statistic(const std::string& name, ParquetType type) {
    const auto found = std::ranges::find(statistics_, name, &ParquetColumn::name);
    ParquetColumn& column =
        found != statistics_.end() ? *found : statistics_.emplace_back(name, type, ParquetShape::list);
    column.begin_list();
    return column;
  }
  void add_statistics(std::size_t feature, const std::vector<double>& values) {
    const FeatureStatistics found = statistics_of(values, features_[feature].width());
    const std::string prefix = "stats/" + features_[feature].name + "/";
    for (const auto& [name, numbers] : named(found)) {
      ParquetColumn& column = statistic(prefix + name, ParquetType::float64);
      for (const double number : numbers) column.add(number);
    }
    statistic(prefix + "count", ParquetType::int64).add(static_cast<std::int64_t>(found.count));
  }

  const std::vector<Feature>& features_;
  std::vector<std::int64_t> episode_, length_, chunk_, file_, from_, to_;
  std::vector<ParquetColumn> statistics_;
};

// pandas finds a task's number by its text: the text is the table's index.
std::string tasks_file(const std::string& task) {
  const Json text = {{"name", "task"},
                     {"field_name", "task"},
                     {"pandas_type", "unicode"},
                     {"numpy_type", "object"},
                     {"metadata", nullptr}};
  const Json number = {{"name", "task_index"},
                       {"field_name", "task_index"},
                       {"pandas_type", "int64"},
                       {"numpy_type", "int64"},
                       {"metadata", nullptr}};
  const Json names = {{"name", nullptr},
                      {"field_name", nullptr},
                      {"pandas_type", "unicode"},
                      {"numpy_type", "object"},
                      {"metadata", {{"encoding", "UTF-8"}}}};
  const Json pandas = {{"index_columns", {"task"}},
                       {"column_indexes", Json::array({names})},
                       {"columns", Json::array({number, text})},
                       {"creator", {{"library", "takt"}}},
                       {"pandas_version", "1.5.3"}};
  ParquetRowGroup columns{{"task_index", ParquetType::int64, ParquetShape::required},
                          {"task", ParquetType::text, ParquetShape::required}};
  columns[0].add(kTaskIndex);
  columns[1].add(std::string_view(task));
  return parquet_file("tasks", {&columns, 1}, {{"pandas", pandas.dump()}});
}

Json json_of(const Feature& feature) {
  Json json = {{"dtype", feature.type == ParquetType::float32 ? "float32" : "int64"}, {"shape", {feature.width()}}};
  json["names"] = feature.names.empty() ? Json(nullptr) : Json(feature.names);
  if (!feature.units.empty()) json["units"] = feature.units;
  return json;
}

Json info_of(const Robot& robot, const std::vector<Feature>& features, std::int64_t episodes, std::int64_t frames) {
  Json json = {{"codebase_version", "v3.0"},
               {"robot_type", robot.name},
               {"total_episodes", episodes},
               {"total_frames", frames},
               {"total_tasks", 1},
               {"chunks_size", kFilesPerChunk},
               {"data_files_size_in_mb", kDataFileBytes >> 20U},
               {"video_files_size_in_mb", 200},
               {"fps", frames_per_second(robot.period)},
               {"splits", {{"train", fmt::format("0:{}", episodes)}}},
               {"data_path", "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"},
               {"video_path", nullptr}};
  for (const Feature& feature : features) json["features"][feature.name] = json_of(feature);
  return json;
}

// Writes a data set's files below a folder; keeps the first failure.
class Writer {
 public:
  explicit Writer(std::filesystem::path folder) : folder_(std::move(folder)) {}
  void write(const std::string& name, const std::string& content) {
    if (!failure_.empty()) return;
    const std::filesystem::path path = folder_ / name;
    std::error_code error;
    std::filesystem::create_directories(path.parent_path(), error);
    if (error)
      failure_ = fmt::format("cannot make {}: {}", path.parent_path().string(), error.message());
    else if (auto done = monitor::replace_file(path, content); !done)
      failure_ = done.error();
  }
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  std::filesystem::path folder_;
  std::string failure_;
};

std::string data_name(std::int64_t file) {
  return fmt::format("data/chunk-{:03}/file-{:03}.parquet", file / kFilesPerChunk, file % kFilesPerChunk);
}

// Of a policy that took the place of the run's own nothing but the leading 64 bits is known.
Json sha256_of(const RunEpisodes& run, const std::string& policy_hash) {
  return run.policy_sha256.starts_with(policy_hash) ? Json(run.policy_sha256) : Json(nullptr);
}

// Episode after episode into data files, and what the tables about them need.
class DataSetBuilder {
 public:
  DataSetBuilder(const Robot& robot, Writer& writer, std::size_t file_bytes)
      : file_bytes_(file_bytes),
        fps_(frames_per_second(robot.period)),
        features_(features_of(robot)),
        table_(features_),
        all_(features_.size()),
        writer_(writer) {}

  void add(const RunEpisodes& run, const Episode& episode) {
    if (bytes_ >= file_bytes_) end_file();
    const FeatureValues values = values_of(episode, place_, fps_);
    groups_.push_back(row_group_of(features_, values));
    bytes_ += bytes_of(groups_.back());
    table_.add(episode, place_, values);
    for (std::size_t each = 0; each < values.size(); ++each)
      all_[each].insert(all_[each].end(), values[each].begin(), values[each].end());
    const std::string policy_hash = fmt::format("{:016x}", episode.policy);
    sources_.push_back({{"episode_index", place_.episode},
                        {"run_id", run.run_id},
                        {"first_tick", episode.first_tick},
                        {"last_tick", episode.last_tick},
                        {"config_sha256", run.config_sha256},
                        {"policy_hash", policy_hash},
                        {"policy_sha256", sha256_of(run, policy_hash)}});
    ++place_.episode;
    place_.first_index += static_cast<std::int64_t>(episode.frames);
  }

  void finish(const Robot& robot, const std::string& task) {
    end_file();
    Json statistics;
    for (std::size_t each = 0; each < features_.size(); ++each) {
      const FeatureStatistics found = statistics_of(all_[each], features_[each].width());
      Json& json = statistics[features_[each].name];
      for (const auto& [name, numbers] : named(found)) json[name] = numbers;
      json["count"] = {found.count};
    }
    writer_.write("meta/info.json", info_of(robot, features_, place_.episode, place_.first_index).dump(2) + "\n");
    writer_.write("meta/stats.json", statistics.dump(2) + "\n");
    writer_.write("meta/tasks.parquet", tasks_file(task));
    writer_.write("meta/episodes/chunk-000/file-000.parquet", table_.file(task));
    const Json origin = {{"schema", "takt.lerobot_origin/1"}, {"period_ns", robot.period.ns}, {"episodes", sources_}};
    writer_.write("meta/takt.json", origin.dump(2) + "\n");
  }

 private:
  void end_file() {
    writer_.write(data_name(place_.file), parquet_file("frames", groups_, {}));
    groups_.clear();
    bytes_ = 0;
    ++place_.file;
  }

  std::size_t file_bytes_;
  std::int64_t fps_;
  std::vector<Feature> features_;
  EpisodeTable table_;
  FeatureValues all_;  // of the whole data set
  Writer& writer_;
  Place place_;
  std::vector<ParquetRowGroup> groups_;  // of the data file that is being filled
  std::size_t bytes_ = 0;
  Json sources_ = Json::array();
};

}  // namespace

std::int64_t frames_per_second(Duration period) {
  return std::llround(1e9 / static_cast<double>(period.ns));
}

std::expected<void, std::string> write_lerobot(std::span<const RunEpisodes> runs, const std::string& task,
                                               const std::string& folder, std::size_t data_file_bytes) {
  std::filesystem::path place = std::filesystem::path(folder).lexically_normal();
  if (!place.has_filename()) place = place.parent_path();
  std::error_code error;
  if (std::filesystem::exists(place, error)) return std::unexpected(fmt::format("{} exists already", place.string()));
  const std::filesystem::path beside = place.string() + ".partial";
  if (!std::filesystem::create_directories(beside, error)) {
    return std::unexpected(
        fmt::format("cannot make {}: {}", beside.string(), error ? error.message() : "it exists already; remove it"));
  }
  Writer writer(beside);
  DataSetBuilder builder(runs.front().robot, writer, data_file_bytes);
  for (const RunEpisodes& run : runs)
    for (const Episode& episode : run.episodes) builder.add(run, episode);
  builder.finish(runs.front().robot, task);
  std::string failure = writer.failure();
  if (failure.empty()) {
    std::filesystem::rename(beside, place, error);
    if (error) failure = fmt::format("cannot move {} to {}: {}", beside.string(), place.string(), error.message());
  }
  if (failure.empty()) return {};
  std::filesystem::remove_all(beside, error);
  return std::unexpected(failure);
}

}  // namespace takt::data_set
