// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/descriptor.hpp"

#include <unistd.h>

#include <utility>

namespace takt::ipc {

Descriptor::Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  if (this != &other) {
    close();
    fd_ = other.release();
  }
  return *this;
}

Descriptor::~Descriptor() {
  close();
}

int Descriptor::release() {
  return std::exchange(fd_, -1);
}

void Descriptor::close() {
  if (const int fd = release(); fd >= 0) ::close(fd);
}

}  // namespace takt::ipc
