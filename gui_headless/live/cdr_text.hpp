#pragma once

#include "model/scene.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

namespace subworld::live {

/// Little-endian plain CDR.
class CdrText {
 public:
  CdrText() : bytes_{0, 1, 0, 0} {}

  template <class T>
  void put(T value) {
    align(sizeof value);
    std::array<std::uint8_t, sizeof value> raw;
    std::memcpy(raw.data(), &value, sizeof value);
    bytes_.insert(bytes_.end(), raw.begin(), raw.end());
  }
  void put_text(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    bytes_.push_back(0);
  }
  void put(const Vec3& v) {
    for (int axis = 0; axis < 3; ++axis) put(v[axis]);
  }
  void put(const std::array<double, 4>& numbers) {
    for (const double part : numbers) put(part);
  }
  void put_pose(const Vec3& position, const Quat& orientation) {
    put(position);
    for (const double part : {orientation.x(), orientation.y(), orientation.z(), orientation.w()}) put(part);
  }
  void put_time(std::uint64_t time_ns) {
    put(static_cast<std::uint32_t>(time_ns / 1'000'000'000));
    put(static_cast<std::uint32_t>(time_ns % 1'000'000'000));
  }
  /// Length of a sequence, to be set when it is known.
  std::size_t put_length() {
    put(std::uint32_t{0});
    return bytes_.size() - sizeof(std::uint32_t);
  }
  void set_length(std::size_t at, std::uint32_t length) { std::memcpy(bytes_.data() + at, &length, sizeof length); }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }
  void reserve(std::size_t size) { bytes_.reserve(size); }

 private:
  void align(std::size_t size) {
    constexpr std::size_t kHeader = 4;
    while ((bytes_.size() - kHeader) % size != 0) bytes_.push_back(0);
  }
  std::vector<std::uint8_t> bytes_;
};

}  // namespace subworld::live
