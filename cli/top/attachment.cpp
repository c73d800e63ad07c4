// SPDX-License-Identifier: Apache-2.0
#include "cli/top/attachment.hpp"

#include <utility>

#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::monitor::top {
namespace {

constexpr Duration kTryEvery = milliseconds(500);
constexpr Duration kAskEvery = seconds(1);

}  // namespace

Attachment::Attachment(const config::RobotConfig& robot, std::string runtime_directory, LiveView& view)
    : robot_(robot),
      runtime_directory_(std::move(runtime_directory)),
      view_(view),
      sink_{.command = [](const RecordedCommand&) {},
            .tick = [this](const TickRecord& record) { view_.tick(record); },
            .keyframe = [](const RecordedKeyframe&) {},
            .frame = [this](const FrameRecord& frame) { view_.frame(frame); },
            .loss = [this](const Loss& loss) { view_.loss(loss); }} {}

void Attachment::look(MonoTime now) {
  if (session_ && session_->is_over()) {
    stream_->drain(sink_, true);
    stream_.reset();
    session_.reset();
    view_.wait("the executive ended");
  }
  if (!session_) attach(now);
  if (!session_) return;
  stream_->drain(sink_, false);
  ask_status(now);
}

void Attachment::attach(MonoTime now) {
  if (tried_at_.is_set() && now - tried_at_ < kTryEvery) return;
  tried_at_ = now;
  auto session = ExecutiveSession::attach(Role::viewer, "takt-top", runtime_directory_, robot_, kPatience);
  if (!session) return view_.wait(session.error());
  auto stream = RecordStream::attach(session->rings(), robot_.joints.size(), config::largest_command_of(robot_));
  if (!stream) return view_.wait(stream.error());
  session_ = std::move(*session);
  stream_ = std::move(*stream);
  asked_at_ = {};
  view_.begin();
}

void Attachment::ask_status(MonoTime now) {
  if (asked_at_.is_set() && now - asked_at_ < kAskEvery) return;
  asked_at_ = now;
  const auto reply = ipc::ask(config::executive_socket(runtime_directory_), OperatorVerb::status, kPatience);
  if (reply) view_.status(*reply);
}

}  // namespace takt::monitor::top
