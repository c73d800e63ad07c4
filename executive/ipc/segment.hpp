// SPDX-License-Identifier: Apache-2.0
// A memfd that cannot be truncated under its readers, and its mapping.
//
// Two sealing orders, both measured to hold (ftruncate, hole punching, write() and new writable maps all fail):
//  - our own data, handed out for reading: create -> map writable -> seal_against_new_writers -> hand out;
//  - a peer's mailbox that we read: create unmapped -> peer maps writable and acknowledges ->
//    seal_against_new_writers -> map_read_only. A new segment per writer session.
// Every segment is sealed SHRINK|GROW from birth, and one that is not is refused: truncating a mapped file raises
// SIGBUS in its readers, locked memory or not. Source: fcntl(2) "File Sealing", memfd_create(2). Errors are one
// sentence with errno's text. Thread rule: set-up only, never on the control thread.
#pragma once

#include <cstddef>
#include <expected>
#include <span>
#include <string>
#include <utility>

#include "executive/ipc/descriptor.hpp"

namespace takt::ipc {

class Segment {
 public:
  // Zeroed, SHRINK|GROW sealed, mapped writable and pre-faulted when `map_writable`, else unmapped.
  static std::expected<Segment, std::string> create(const char* name, std::size_t bytes, bool map_writable);
  // Takes ownership of a received descriptor, checks that it is a memfd sealed against shrinking and growing and at
  // least `bytes` long, and maps that many bytes.
  static std::expected<Segment, std::string> adopt_read_only(int fd, std::size_t bytes);
  static std::expected<Segment, std::string> adopt_writable(int fd, std::size_t bytes);

  Segment(Segment&& other) noexcept;
  Segment& operator=(Segment&& other) noexcept;
  Segment(const Segment&) = delete;
  Segment& operator=(const Segment&) = delete;
  ~Segment();

  // Adds FUTURE_WRITE|SEAL: writable maps that exist keep working, no new one can be made.
  std::expected<void, std::string> seal_against_new_writers();
  // Maps read-only and pre-faults (a segment created unmapped, after its writer mapped it).
  std::expected<void, std::string> map_read_only();

  [[nodiscard]] int fd() const { return file_.get(); }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::span<std::byte> writable();              // empty unless mapped writable
  [[nodiscard]] std::span<const std::byte> readable() const;  // empty unless mapped

 private:
  Segment(Descriptor file, std::size_t size) : file_(std::move(file)), size_(size) {}
  static std::expected<Segment, std::string> adopt(int fd, std::size_t bytes, bool writable);
  std::expected<void, std::string> map(bool writable);
  void unmap();

  Descriptor file_;
  std::size_t size_ = 0;
  std::byte* data_ = nullptr;
  bool writable_ = false;
};

}  // namespace takt::ipc
