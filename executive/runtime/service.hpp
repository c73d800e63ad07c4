// SPDX-License-Identifier: Apache-2.0
// What the service thread does while the control thread ticks: receives peers, writes the log, reports to the service
// manager, and carries out the shutdown when a signal asks for it. Thread rule: service thread.
#pragma once

#include "executive/runtime/drive_cards.hpp"
#include "executive/runtime/imu_link.hpp"
#include "executive/runtime/operator_inbox.hpp"
#include "executive/runtime/reception.hpp"
#include "executive/runtime/status_board.hpp"
#include "executive/runtime/tick_follower.hpp"
#include "executive/runtime/transmit_queues.hpp"
#include "executive/trace/trace.hpp"

namespace takt::runtime {

// SIGTERM, SIGINT and SIGHUP are blocked from here on, in this thread and those it starts; serve() takes them.
void block_shutdown_signals();

// `imu`: null where the robot has none. Returns when the loop may end: after a signal, once the robot rests or the time
// for it is over.
void serve(Reception& reception, TickFollower& follower, DriveCards& cards, StatusBoard& board, OperatorInbox& requests,
           TransmitQueues& queues, trace::Introduction& introduction, ImuLink* imu = nullptr);

}  // namespace takt::runtime
