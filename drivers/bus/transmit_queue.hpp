// SPDX-License-Identifier: Apache-2.0
// Throws away what an interface still has to send: it is switched off and on again, which empties the kernel's queue
// and makes the controller give up what it holds. Bit timing and queue length stay. Everybody on this machine who
// listens on the interface is told that it went down, ourselves included.
//
// What an adapter's firmware has already taken may still leave, as may what a serial line holds.
// Needs CAP_NET_ADMIN. Error: one sentence. Thread rule: any but the control thread; takes the kernel's network lock.
#pragma once

#include <expected>
#include <string>

namespace takt::drivers {

std::expected<void, std::string> purge_transmit_queue(const std::string& interface);

}  // namespace takt::drivers
