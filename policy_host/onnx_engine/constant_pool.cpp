// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/constant_pool.hpp"

#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <string_view>
#include <utility>

namespace takt::onnx_engine {

namespace {

std::string_view bytes_of(const float* floats, std::size_t count) {
  return {reinterpret_cast<const char*>(floats), count * sizeof(float)};
}

class ConstantPool {
 public:
  SharedFloats share(FloatBuffer floats, std::size_t count) {
    const std::string_view bytes = bytes_of(floats.get(), count);
    const std::lock_guard lock(mutex_);
    std::erase_if(known_, [](const auto& one) { return one.second.floats.expired(); });
    const std::size_t hash = std::hash<std::string_view>{}(bytes);
    const auto [first, last] = known_.equal_range(hash);
    for (auto one = first; one != last; ++one) {
      SharedFloats alive = one->second.floats.lock();
      if (alive && bytes_of(alive.get(), one->second.count) == bytes) return alive;
    }
    SharedFloats ours(std::move(floats));
    known_.emplace(hash, Known{ours, count});
    return ours;
  }

 private:
  struct Known {
    std::weak_ptr<const float[]> floats;
    std::size_t count;
  };
  std::mutex mutex_;
  std::multimap<std::size_t, Known> known_;  // by hash of the bytes
};

}  // namespace

SharedFloats share_constant(FloatBuffer floats, std::size_t count) {
  static ConstantPool pool;
  return pool.share(std::move(floats), count);
}

}  // namespace takt::onnx_engine
