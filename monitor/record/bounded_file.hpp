// SPDX-License-Identifier: Apache-2.0
// A file that grows by whole pieces, up to a limit, and says once why it stopped.
//
// append() writes all of a piece or none: after a short write (disk full, RLIMIT_FSIZE, limit reached) the file is cut
// back to the last whole piece, failure() holds one sentence, and every later append is refused. sync() likewise: what
// the medium did not take (quota, I/O error at write-back) is cut off, back to what an earlier sync() brought there;
// and a file that another program deleted, renamed, replaced or cut takes no more. Nothing here blocks longer than the
// file system does. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/record/segment_seal.hpp"

namespace takt::monitor {

class BoundedFile {
 public:
  // The file must not exist yet. `max_bytes`: append refuses to grow the file beyond it. Locked (flock) until this or
  // its process ends.
  static std::expected<BoundedFile, std::string> create(const std::string& path, std::uint64_t max_bytes);
  BoundedFile(BoundedFile&& other) noexcept;
  BoundedFile& operator=(BoundedFile&&) = delete;
  BoundedFile(const BoundedFile&) = delete;
  BoundedFile& operator=(const BoundedFile&) = delete;
  ~BoundedFile();

  bool append(std::span<const std::byte> piece);
  bool append(std::string_view text) { return append(std::as_bytes(std::span(text))); }
  // A failed file may take pieces again, up to `max_bytes`: for the closing words once room was made.
  void reopen(std::uint64_t max_bytes);
  // To the medium. False once: what was appended since the last sync() is gone.
  bool sync();
  // Precondition: what was appended was synced. Ends a segment of the file's seal.
  void close_segment(std::int64_t until_unix_ns) { seal_.close(until_unix_ns); }
  [[nodiscard]] const std::vector<SealedSegment>& sealed() const { return seal_.closed(); }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  BoundedFile(std::string path, int fd, std::uint64_t max_bytes)
      : path_(std::move(path)), fd_(fd), max_bytes_(max_bytes) {}
  void cut_back_to(std::uint64_t size);
  bool is_where_it_was();  // false: failure() says what became of it
  std::string path_;
  int fd_;
  std::uint64_t max_bytes_;
  std::uint64_t size_ = 0, synced_ = 0;
  SegmentSeal seal_;
  std::string failure_;
};

// Whether a BoundedFile of any process has it open, a stopped process too. A link is not followed.
bool is_being_written(const std::string& path);

// Replaces `path` by `text` so that a reader sees the old or the new content, never a part; synced. A link at `path`
// is replaced, not followed. A device, a pipe or a socket is written to and stays what it is.
std::expected<void, std::string> replace_file(const std::string& path, std::string_view text);
// The whole of a regular file, or of what /dev/ names. A pipe or a device elsewhere is refused: it may never end.
std::expected<std::string, std::string> read_file(const std::string& path);

}  // namespace takt::monitor
