// SPDX-License-Identifier: Apache-2.0
// Goal: the run's own network gives the same bits again, whatever it remembers, and every deviation is told for what it
// is: another file, an altered record, answers that are missing, a command that is not what the network said. Method: a
// host without sockets answers observations with a network whose arithmetic is known, its evidence is written as the
// recorder does, and spoilt in one way at a time.
#include "evidence/policy/policy_replay.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <functional>

#include "config/load.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/image_store.hpp"
#include "monitor/record/mcap_writer.hpp"
#include "policy_host/input_evidence.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/responder.hpp"
#include "tests/policy_host/onnx/onnx_graph_maker.hpp"
#include "tests/policy_host/small_robot.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

using onnx_engine::GraphMaker;

void shape_outputs(GraphMaker& maker) {
  for (onnx::ValueInfoProto& output : *maker.graph().mutable_output())
    for (const std::int64_t size : {1, 2})
      output.mutable_type()->mutable_tensor_type()->mutable_shape()->add_dim()->set_dim_value(size);
}

// actions = factor * (obs + h_in), h_out = obs + h_in.
GraphMaker accumulator(float factor) {
  GraphMaker maker;
  maker.input("obs", {1, 2}).input("h_in", {1, 2}).output("actions").output("h_out").floats("factor", {1}, {factor});
  maker.node("Add", {"obs", "h_in"}, {"h_out"});
  maker.node("Mul", {"h_out", "factor"}, {"actions"});
  shape_outputs(maker);
  return maker;
}

// actions = factor * obs.
GraphMaker forgetful(float factor) {
  GraphMaker maker;
  maker.input("obs", {1, 2}).output("actions").floats("factor", {1}, {factor});
  maker.node("Mul", {"obs", "factor"}, {"actions"});
  shape_outputs(maker);
  return maker;
}

// actions = 0 / 0: a network that diverges, though its weights are numbers.
GraphMaker diverging() {
  GraphMaker maker;
  maker.input("obs", {1, 2}).output("actions").floats("factor", {1}, {0.0F});
  maker.node("Mul", {"obs", "factor"}, {"zero"});
  maker.node("Div", {"zero", "zero"}, {"actions"});
  shape_outputs(maker);
  return maker;
}

// actions = obs * weights, of two joints and two images of 1 x 2 x 2.
GraphMaker seeing() {
  GraphMaker maker;
  std::vector<float> weights(20);
  for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = 0.25F * static_cast<float>(i + 1);
  maker.input("obs", {1, 10}).output("actions").floats("weights", {10, 2}, weights);
  maker.node("MatMul", {"obs", "weights"}, {"actions"});
  shape_outputs(maker);
  return maker;
}

MonoTime still_clock() {
  return MonoTime{} + seconds(5);
}

struct Answer {
  RecordedCommand command;
  RecordedPolicyInput input;
  bool has_evidence = true;  // what its host said of it was recorded
};

class PolicyReplayTest : public takt::test::TemporaryFolder {
 protected:
  std::string write(const std::string& name, const GraphMaker& maker) {
    std::ofstream(path(name), std::ios::binary) << maker.model.SerializeAsString();
    return path(name);
  }
  // Two joints, one step, targets equal to the network's outputs.
  static config::RobotConfig robot(const std::string& file) {
    config::RobotConfig robot = policy_host::small_robot();
    robot.joints.resize(2);
    robot.sensors.clear();
    robot.policy->file = file;
    robot.policy->steps = 1;
    robot.policy->observation = {policy_host::term(config::TermKind::joint_position, 1)};
    robot.policy->action.offset = config::OffsetKind::zero;
    return robot;
  }
  static Observation observation(std::uint64_t id) {
    Observation observation = policy_host::small_observation(id);
    observation.joint_count = 2;
    observation.q[0] = 0.1F * static_cast<float>(id);
    observation.q[1] = -1.0F / static_cast<float>(id);
    return observation;
  }
  // What the host of `robot` answers to these observations.
  static std::vector<Answer> answers(const config::RobotConfig& robot, const std::vector<std::uint64_t>& ids,
                                     bool built_in = true) {
    const std::uint64_t hash = config::policy_hash(robot.policy->file).value();
    const auto policy = policy_host::load_onnx_policy(robot.policy->file, "obs", "actions").value();
    policy_host::Responder responder(robot, hash, *policy);
    policy_host::InputEvidence evidence(robot, hash, built_in);
    responder.start_session();
    std::vector<Answer> all;
    for (const std::uint64_t id : ids) {
      const CommandChunk& chunk = responder.answer(observation(id), {}, still_clock(), still_clock);
      const auto payload = evidence.pack(observation(id), {}, chunk.header.sequence, responder.inference());
      const auto bytes = std::as_bytes(std::span(&chunk, 1)).first(chunk.used_bytes());
      Answer answer;
      answer.command.payload.assign(bytes.begin(), bytes.end());
      answer.input.input = read_policy_input(payload).value();
      answer.input.crc = crc_of(answer.input.input);
      all.push_back(std::move(answer));
    }
    return all;
  }
  // A run of this robot, as far as replay looks at one.
  RecordedRun run(const config::RobotConfig& robot, const std::vector<Answer>& answers,
                  const std::vector<Loss>& losses = {}) {
    RecordedRun run{RunFolder::create(path("run")).value(), {}, robot};
    run.manifest.policy_file = robot.policy->file;
    run.robot.policy->file = path("run/policy.onnx");  // as config.yaml, which lies there, names it
    auto writer = McapWriter::create(run.folder.ticks(), 1U << 30U, run_topics(), {}).value();
    CdrWriter message;
    for (const Answer& answer : answers) {
      encode_command(answer.command, message);
      writer.write(static_cast<std::uint16_t>(Topic::command), 1, message.bytes());
      if (!answer.has_evidence) continue;
      encode_policy_input(answer.input, message);
      writer.write(static_cast<std::uint16_t>(Topic::policy_input), 1, message.bytes());
    }
    for (const Loss& loss : losses) {
      encode_loss(loss, message);
      writer.write(static_cast<std::uint16_t>(Topic::loss), 1, message.bytes());
    }
    EXPECT_TRUE(writer.finish());
    return run;
  }
  static evidence::PolicyReplayReport replayed(const RecordedRun& run,
                                               const evidence::PolicyReplayOptions& options = {}) {
    auto report = evidence::replay_policy(run, options);
    if (!report) throw std::runtime_error(report.error().sentence);
    return *std::move(report);
  }
  static std::string refusal(const RecordedRun& run, evidence::PolicyReplayRefusal::Why why,
                             const evidence::PolicyReplayOptions& options = {}) {
    const auto report = evidence::replay_policy(run, options);
    if (report) return "it was replayed";
    EXPECT_EQ(report.error().why, why);
    return report.error().sentence;
  }
};

const config::ImageShape kSmall{1, 2, 2};

std::vector<std::uint8_t> pixels_of(std::uint64_t id) {
  std::vector<std::uint8_t> pixels(kSmall.bytes());
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(31 * id + i);
  return pixels;
}

// Goal: what a network saw is put together again from the files of the run, histories included, bit for bit; what rests
// on a file that was lost, altered or never kept is not judged, and the first is named. Method: a network of two images
// in a row; image `id` was shown with observation `id`, and is in the run folder as the recorder keeps it.
class SeeingReplayTest : public PolicyReplayTest {
 protected:
  SeeingReplayTest() : robot_(robot(write("policy.onnx", seeing()))) {
    robot_.sensors.push_back({.name = "cam0", .timeout = milliseconds(200), .image = kSmall});
    robot_.policy->observation.push_back(policy_host::term(config::TermKind::sensor, 1, 2));
    robot_.policy->observation.back().sensor = "cam0";
    const std::uint64_t hash = config::policy_hash(robot_.policy->file).value();
    const auto policy = policy_host::load_onnx_policy(robot_.policy->file, "obs", "actions").value();
    policy_host::Responder responder(robot_, hash, *policy);
    policy_host::InputEvidence evidence(robot_, hash, true);
    responder.start_session();
    for (std::uint64_t id = 1; id <= 4; ++id) {
      const SensorSample sample = sample_of(id);
      const auto pixels = pixels_of(id);
      const std::array<std::span<const std::uint8_t>, 1> images{pixels};
      const CommandChunk& chunk =
          responder.answer(observation(id), std::span(&sample, 1), still_clock(), still_clock, images);
      Answer answer;
      const auto bytes = std::as_bytes(std::span(&chunk, 1)).first(chunk.used_bytes());
      answer.command.payload.assign(bytes.begin(), bytes.end());
      answer.input.input = read_policy_input(evidence.pack(observation(id), std::span(&sample, 1),
                                                           chunk.header.sequence, responder.inference()))
                               .value();
      answer.input.crc = crc_of(answer.input.input);
      answers_.push_back(std::move(answer));
    }
  }
  static SensorSample sample_of(std::uint64_t id) {
    SensorSample sample;
    sample.sequence = id;
    sample.sensed_at = MonoTime{} + milliseconds(static_cast<std::int64_t>(id));
    sample.published_at = sample.sensed_at + milliseconds(1);
    return sample;
  }
  RecordedRun seen_run(ImageFile of_third = ImageFile::stored) {
    RecordedRun run{RunFolder::create(path("run")).value(), {}, robot_};
    run.manifest.policy_file = robot_.policy->file;
    auto writer = McapWriter::create(run.folder.ticks(), 1U << 30U, run_topics(), {}).value();
    ImageStore store(run.folder, {.budget_mib = 1, .rate_mib_per_s = 1});
    CdrWriter message;
    for (const Answer& answer : answers_) {
      encode_command(answer.command, message);
      writer.write(static_cast<std::uint16_t>(Topic::command), 1, message.bytes());
      encode_policy_input(answer.input, message);
      writer.write(static_cast<std::uint16_t>(Topic::policy_input), 1, message.bytes());
    }
    for (std::uint64_t id = 1; id <= 4; ++id) {  // behind the inputs that name them
      const SensorSample sample = sample_of(id);
      const auto pixels = pixels_of(id);
      const std::string content = image_file(kSmall, std::as_bytes(std::span(pixels)));
      ShownImage image{.sequence = sample.sequence,
                       .sensed_at = sample.sensed_at,
                       .published_at = sample.published_at,
                       .sensor = 0,
                       .shape = kSmall,
                       .file = id == 3 ? of_third : ImageFile::stored,
                       .sha256 = config::sha256_hex(content)};
      names_.push_back(run.folder.images() + "/" + image_file_name(kSmall, image.sha256));
      if (image.file == ImageFile::stored) {
        EXPECT_EQ(store.keep(image, content, MonoTime{1}), ImageFile::stored);
      }
      if (image.file == ImageFile::unseen) image.sha256.clear();
      encode_image(image, message);
      writer.write(static_cast<std::uint16_t>(Topic::image), 1, message.bytes());
    }
    EXPECT_TRUE(writer.finish());
    return run;
  }
  // Of the answers 3 and 4, whose histories hold image 3.
  void expect_not_judged(const RecordedRun& run, const std::string& said) {
    const auto report = replayed(run);
    const evidence::PolicyReplay& policy = report.policies.front();
    EXPECT_EQ(policy.answers, 4U);
    EXPECT_EQ(policy.not_judged, 2U);
    EXPECT_EQ(policy.without_image, 2U);
    EXPECT_EQ(policy.identical, 2U);
    EXPECT_EQ(policy.first_without_image.find("observation 3: cam0: "), 0U) << policy.first_without_image;
    EXPECT_NE(policy.first_without_image.find(said), std::string::npos) << policy.first_without_image;
    EXPECT_NE(evidence::policy_replay_text(report).find("2 of them rest on an image without a sound file"),
              std::string::npos);
    EXPECT_FALSE(report.is_whole());
    EXPECT_TRUE(report.agrees());
  }

  config::RobotConfig robot_;
  std::vector<Answer> answers_;
  std::vector<std::string> names_;  // of the images' files
};

TEST_F(SeeingReplayTest, TheNetworkIsShownTheFilesAndSaysTheSameBits) {
  for (const Answer& answer : answers_) EXPECT_EQ(answer.input.input.input.size(), 2U) << "no image is in there";
  const auto report = replayed(seen_run());
  EXPECT_EQ(report.policies.front().identical, 4U);
  EXPECT_TRUE(report.agrees());
  EXPECT_TRUE(report.is_whole());
}

TEST_F(SeeingReplayTest, AnImageThatWasLostOrAlteredSinceIsNamed) {
  const RecordedRun run = seen_run();
  std::ofstream(names_[2], std::ios::binary | std::ios::app) << 'x';
  expect_not_judged(run, "is not what was recorded");
  std::filesystem::remove(names_[2]);
  expect_not_judged(run, "is missing: it was lost since the run");
}

TEST_F(SeeingReplayTest, AnImageWithoutAFileIsNamedWithTheReason) {
  expect_not_judged(seen_run(ImageFile::over_budget), "went without a file: over_budget");
  std::filesystem::remove_all(path("run"));
  expect_not_judged(seen_run(ImageFile::unseen), "the recorder never had its image 3");
}

// From 3 to 200 is a gap behind which the host forgets.
const std::vector<std::uint64_t> kIds{1, 2, 3, 200, 201, 202};

TEST_F(PolicyReplayTest, TheSameFileGivesTheSameBitsWithItsMemoryAndItsResets) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  const auto report = replayed(run(robot_of, answers(robot_of, kIds)));
  ASSERT_EQ(report.policies.size(), 1U);
  const evidence::PolicyReplay& policy = report.policies.front();
  EXPECT_TRUE(policy.is_of_the_run);
  EXPECT_EQ(policy.answers, 6U);
  EXPECT_EQ(policy.identical, 6U);
  EXPECT_EQ(policy.commands, 6U);
  EXPECT_EQ(policy.as_answered, 6U);
  EXPECT_TRUE(report.agrees());
  EXPECT_TRUE(report.is_whole());
  EXPECT_NE(evidence::policy_replay_text(report).find("6 of 6 answers reproduce bit for bit"), std::string::npos);
}

TEST_F(PolicyReplayTest, AnotherFileGivesTheDistancesOfItsTargets) {
  const auto robot_of = robot(write("policy.onnx", forgetful(10)));
  const RecordedRun recorded = run(robot_of, answers(robot_of, {1, 2}));
  evidence::PolicyReplayOptions options{write("other.onnx", forgetful(11)), 0.15};
  const auto report = replayed(recorded, options);
  const evidence::PolicyReplay& policy = report.policies.front();
  EXPECT_FALSE(policy.is_of_the_run);
  EXPECT_EQ(policy.identical, 0U);
  EXPECT_FALSE(report.agrees());
  ASSERT_EQ(policy.joints.size(), 2U);
  EXPECT_NEAR(policy.joints[0].largest, 0.2, 1e-5) << "q of the first joint: 0.1 and 0.2";
  EXPECT_NEAR(policy.joints[0].rms, std::sqrt((0.01 + 0.04) / 2), 1e-5);
  EXPECT_NEAR(policy.joints[1].largest, 1, 1e-5) << "of the second: -1 and -0.5";
  EXPECT_EQ(policy.beyond, 2U);
  ASSERT_TRUE(policy.first_beyond);
  EXPECT_EQ(policy.first_beyond->observation_id, 1U);
  EXPECT_EQ(policy.first_beyond->joint, "b") << "the first joint is only 0.1 away";
  EXPECT_NEAR(policy.first_beyond->recorded, -10, 1e-5);
  EXPECT_NEAR(policy.first_beyond->recomputed, -11, 1e-5);
  EXPECT_EQ(policy.as_answered, 2U) << "the run itself is sound";
  options.tolerance = 2;
  EXPECT_TRUE(replayed(recorded, options).agrees());
}

// Goal: what is said of a slide's targets is in its unit. Method: one of two joints slides.
TEST_F(PolicyReplayTest, ASlidesTargetsAreInMetres) {
  auto robot_of = robot(write("policy.onnx", forgetful(10)));
  robot_of.joints[1].kind = config::JointKind::slide;
  const auto report = replayed(run(robot_of, answers(robot_of, {1})), {write("other.onnx", forgetful(11)), 0.15});
  const evidence::PolicyReplay& policy = report.policies.front();
  EXPECT_EQ(policy.unit, "rad (slides: m)");
  EXPECT_EQ(policy.joints[0].unit, "rad");
  EXPECT_EQ(policy.joints[1].unit, "m");
  EXPECT_EQ(to_json(report).at("policies").at(0).at("joints").at(1).at("unit"), "m");
}

// A distance of NaN compares with nothing: it must not pass for a small one.
TEST_F(PolicyReplayTest, ATargetThatIsNoNumberIsBeyondAnyTolerance) {
  const auto robot_of = robot(write("policy.onnx", forgetful(10)));
  const RecordedRun recorded = run(robot_of, answers(robot_of, {1}));
  const auto report = replayed(recorded, {write("other.onnx", diverging()), 1e6});
  EXPECT_EQ(report.policies.front().beyond, 1U);
  EXPECT_FALSE(report.agrees());
}

TEST_F(PolicyReplayTest, AFlippedBitIsNamedAndTheRestStillReproduces) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &all[1].input.input.input[1], sizeof bits);
  bits ^= 0x10U;
  std::memcpy(&all[1].input.input.input[1], &bits, sizeof bits);
  const auto report = replayed(run(robot_of, all));
  const evidence::PolicyReplay& policy = report.policies.front();
  EXPECT_EQ(policy.altered, 1U);
  EXPECT_EQ(policy.first_altered, "observation 2: input[1]");
  EXPECT_EQ(policy.identical, 6U) << "as it was before the bit flipped";
  EXPECT_FALSE(report.agrees());
}

TEST_F(PolicyReplayTest, WhatWasAlteredBeyondRepairIsNotJudgedNorWhatRemembersIt) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  all[1].input.input.input = {3, 4};
  const auto report = replayed(run(robot_of, all));
  const evidence::PolicyReplay& policy = report.policies.front();
  EXPECT_EQ(policy.altered, 1U);
  EXPECT_EQ(policy.not_judged, 2U) << "2 itself, and 3, which remembers it; 200 began anew";
  EXPECT_EQ(policy.identical, 4U);
  EXPECT_FALSE(report.agrees());
}

TEST_F(PolicyReplayTest, BehindAMissingAnswerOnlyAMemoryIsUnknown) {
  for (const bool remembers : {true, false}) {
    std::filesystem::remove_all(path("run"));
    const auto robot_of = robot(write("policy.onnx", remembers ? accumulator(10) : forgetful(10)));
    auto all = answers(robot_of, kIds);
    all.erase(all.begin() + 1);
    const auto report = replayed(run(robot_of, all));
    const evidence::PolicyReplay& policy = report.policies.front();
    EXPECT_EQ(policy.missing, 1U);
    EXPECT_EQ(policy.not_judged, remembers ? 1U : 0U);
    EXPECT_EQ(policy.identical, policy.answers - policy.not_judged);
    EXPECT_TRUE(report.agrees());
    EXPECT_FALSE(report.is_whole());
  }
}

// The recorder came while the host was at work: what its network remembered then is unknown.
TEST_F(PolicyReplayTest, AMemoryThatBeganUnrecordedIsNotJudged) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  all.erase(all.begin());
  const auto report = replayed(run(robot_of, all));
  EXPECT_EQ(report.policies.front().not_judged, 2U);
  EXPECT_EQ(report.policies.front().identical, 3U);
}

TEST_F(PolicyReplayTest, ACommandThatIsNotWhatTheNetworkSaidIsTold) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  all[4].command.payload.back() ^= std::byte{1};
  all[2].command.payload.clear();  // never read by the executive
  const auto report = replayed(run(robot_of, all));
  EXPECT_EQ(report.policies.front().identical, 6U);
  EXPECT_EQ(report.policies.front().commands, 5U);
  EXPECT_EQ(report.policies.front().as_answered, 4U);
  EXPECT_FALSE(report.agrees());
}

// Whatever became of its answer, cut off the file or never said: a command without one is told, and the run not whole.
TEST_F(PolicyReplayTest, ACommandThatNoAnswerExplainsIsMissing) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  for (std::size_t answer = 3; answer < all.size(); ++answer) all[answer].has_evidence = false;
  const auto report = replayed(run(robot_of, all));
  const evidence::PolicyReplay& policy = report.policies.front();
  EXPECT_EQ(policy.identical, 3U);
  EXPECT_EQ(policy.missing, 0U) << "no answer behind them says that there were any";
  EXPECT_EQ(policy.unanswered, 3U);
  EXPECT_TRUE(report.agrees());
  EXPECT_FALSE(report.is_whole());
  EXPECT_NE(evidence::policy_replay_text(report).find("  3 commands that the executive read are of no recorded answer"),
            std::string::npos);
  EXPECT_EQ(to_json(report).at("policies").at(0).at("unanswered"), 3);
}

// The recorder came late, and said so.
TEST_F(PolicyReplayTest, WhatIsDeclaredLostExplainsAsManyCommands) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  for (std::size_t answer = 0; answer < 3; ++answer) all[answer].has_evidence = false;
  const auto unanswered = [&](const std::vector<Loss>& losses) {
    std::filesystem::remove_all(path("run"));
    const auto report = replayed(run(robot_of, all, losses));
    const evidence::PolicyReplay& policy = report.policies.front();
    EXPECT_EQ(report.is_whole(), policy.unanswered == 0 && policy.lost == 0);
    return policy.unanswered;
  };
  EXPECT_EQ(unanswered({}), 3U);
  EXPECT_EQ(unanswered({{"policy_input", "before_attach", 2, 0, 0}}), 1U);
  EXPECT_EQ(unanswered({{"policy_input", "before_attach", 3, 0, 0}}), 0U);
  EXPECT_EQ(unanswered({{"policy_input", "before_attach", 2, 0, 0}, {"policy_input", "unreadable", 1, 0, 0}}), 0U)
      << "and not whole: an answer is missing";
  EXPECT_EQ(unanswered({{"fallback_input", "before_attach", 3, 0, 0}, {"tick", "overwritten", 3, 0, 0}}), 3U)
      << "of other rings";
}

// A recurrent network's answer behind a gap is not judged, but it is there.
TEST_F(PolicyReplayTest, AnAnswerThatIsNotJudgedStillExplainsItsCommand) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  all.erase(all.begin());
  const auto report = replayed(run(robot_of, all));
  EXPECT_EQ(report.policies.front().not_judged, 2U);
  EXPECT_EQ(report.policies.front().unanswered, 0U);
  EXPECT_EQ(report.policies.front().commands, 5U);
  EXPECT_EQ(report.policies.front().as_answered, 5U);
}

TEST_F(PolicyReplayTest, CommandsOfAFallbackPolicyWithoutAnyAnswerAreTold) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  auto all = answers(robot_of, kIds);
  for (std::size_t answer = 0; answer < 2; ++answer) {
    Answer other = all[answer];
    other.command.sender = Player::fallback;
    other.has_evidence = false;
    all.push_back(other);
  }
  const RecordedRun recorded = run(robot_of, all);
  const auto report = replayed(recorded);
  EXPECT_EQ(report.policies.size(), 1U);
  EXPECT_EQ(report.policies.front().unanswered, 0U);
  EXPECT_EQ(report.fallback_unanswered, 2U);
  EXPECT_TRUE(report.agrees());
  EXPECT_FALSE(report.is_whole());
  EXPECT_TRUE(replayed(recorded, {write("other.onnx", accumulator(10)), 0}).is_whole()) << "nobody asked for it";
}

// Ticks that were taken away took answers with them.
TEST_F(PolicyReplayTest, AFileThatEndsBeforeItsManifestIsNotWhole) {
  const auto robot_of = robot(write("policy.onnx", accumulator(10)));
  RecordedRun cut = run(robot_of, answers(robot_of, kIds));
  cut.manifest.ticks = 1;
  const auto report = replayed(cut);
  EXPECT_EQ(report.missing_ticks, 1U);
  EXPECT_TRUE(report.agrees());
  EXPECT_FALSE(report.is_whole());
  EXPECT_NE(evidence::policy_replay_text(report).find("1 ticks are missing"), std::string::npos);
}

TEST_F(PolicyReplayTest, WhatCannotBeComparedIsRefusedInOneLine) {
  using Why = evidence::PolicyReplayRefusal::Why;
  const auto robot_of = robot(write("policy.onnx", forgetful(10)));
  const auto recorded = answers(robot_of, {1, 2});
  EXPECT_NE(refusal(run(robot_of, {}), Why::no_evidence).find("has no policy inputs"), std::string::npos);
  std::filesystem::remove_all(path("run"));
  EXPECT_NE(refusal(run(robot_of, answers(robot_of, {1}, false)), Why::policy).find("plugin engine"),
            std::string::npos);
  std::filesystem::remove_all(path("run"));
  auto of_client = recorded;
  of_client[0].input.input.header.by_client = 1;
  EXPECT_NE(refusal(run(robot_of, of_client), Why::policy).find("is a program of its own (takt/client.h)"),
            std::string::npos);
  std::filesystem::remove_all(path("run"));
  const RecordedRun good = run(robot_of, recorded);
  GraphMaker wide;
  wide.input("obs", {1, 3}).output("actions").floats("ten", {1}, {10});
  wide.node("Mul", {"obs", "ten"}, {"actions"});
  EXPECT_NE(refusal(good, Why::policy, {write("wide.onnx", wide), 0}).find("wants 3 values"), std::string::npos);
  EXPECT_NE(refusal(good, Why::policy, {path("nowhere.onnx"), 0}).find("nowhere.onnx"), std::string::npos);
  write("policy.onnx", forgetful(11));  // the file was replaced since
  const std::string sentence = refusal(good, Why::policy);
  EXPECT_NE(sentence.find("compare this one by --with"), std::string::npos) << sentence;
}

}  // namespace
}  // namespace takt::monitor
