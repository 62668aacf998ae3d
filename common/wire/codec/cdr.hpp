#pragma once

#include "model/messages/exchange.hpp"
#include "wire/codec/changes.hpp"
#include "wire/codec/readable.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

/// The archives that write and read `fields` as plain CDR (XCDR1). Each number is aligned to its size from the end of
/// the header on. Names do not travel.
namespace subworld {

inline constexpr std::size_t kCdrHeaderBytes = 4;

/// A unit quaternion whose norm is off by less than this is not changed, so that both ends of a topic have equal
/// numbers.
inline constexpr double kQuaternionExact = 1e-6;
/// A quaternion whose norm is off by more than this is invalid; between the two limits it is normalised.
inline constexpr double kQuaternionNear = 1e-2;

template <class T>
concept Number = std::is_arithmetic_v<T>;
template <class T>
concept Enumerator = std::is_enum_v<T>;
template <class T>
concept Sequence = Is<T, std::vector<typename T::value_type>>;
/// Travels as a sequence of length 0 or 1.
template <class T>
concept Optional = Is<T, std::optional<typename T::value_type>>;

/// Writes little-endian, behind a header. Everything counts as valid.
class CdrWriter {
 public:
  static_assert(std::endian::native == std::endian::little);

  /// Overwrites `bytes`, and enlarges them as needed.
  CdrWriter(std::vector<std::uint8_t>& bytes, const Changes& packed) : changes(packed), bytes_(bytes) {
    constexpr std::uint8_t kHeader[kCdrHeaderBytes]{0, 1, 0, 0};
    copy(kHeader, 1, sizeof kHeader);
  }

  const Changes& changes;

  [[nodiscard]] std::span<const std::uint8_t> written() const { return {bytes_.data(), at_}; }

  bool operator()(const char*, const Number auto& value) { return copy(&value, sizeof value, sizeof value); }
  bool operator()(const char*, const Enumerator auto& value) { return copy(&value, sizeof value, sizeof value); }
  bool operator()(const char*, const Vec3& v) { return copy(v.data(), sizeof(double), 3 * sizeof(double)); }
  bool operator()(const char*, const Quat& q) {
    const double numbers[]{q.w(), q.x(), q.y(), q.z()};
    return copy(numbers, sizeof(double), sizeof numbers);
  }
  bool operator()(const char*, const std::array<std::uint32_t, 3>& corners) {
    return copy(corners.data(), sizeof(std::uint32_t), sizeof corners);
  }
  bool operator()(const char* name, const std::string& value) {
    const std::string text = readable(value);
    (*this)(name, static_cast<std::uint32_t>(text.size() + 1));
    return copy(text.c_str(), 1, text.size() + 1);
  }
  bool operator()(const char* name, const Sequence auto& all) {
    return sequence(name, all, [this](std::size_t, const auto& one) { return (*this)("", one); });
  }
  bool operator()(const char* name, const Optional auto& value) {
    (*this)(name, std::uint32_t{value.has_value()});
    return !value || (*this)("", *value);
  }
  bool operator()(const char*, const auto& value) { return fields(*this, value); }
  bool operator()(const char* name, const auto&, const auto& sent) { return (*this)(name, sent); }

  bool sequence(const char* name, const auto& all, auto write) {
    (*this)(name, static_cast<std::uint32_t>(all.size()));
    for (std::size_t i = 0; i < all.size(); ++i) write(i, all[i]);
    return true;
  }
  bool check(bool) const { return true; }

 private:
  bool copy(const void* from, std::size_t alignment, std::size_t size) {
    const std::size_t padding = (kCdrHeaderBytes - at_) & (alignment - 1), to = at_ + padding;
    if (to + size > bytes_.size()) bytes_.resize(std::max(to + size, bytes_.capacity()));
    std::fill_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at_), padding, std::uint8_t{0});
    std::memcpy(bytes_.data() + to, from, size);
    at_ = to + size;
    return true;
  }

  std::vector<std::uint8_t>& bytes_;
  std::size_t at_ = 0;
};

/// Reads either byte order. Each function returns whether the value is there and valid. A sequence grows as its
/// elements are read, so that a corrupt length takes no memory.
class CdrReader {
 public:
  CdrReader(std::span<const std::uint8_t> bytes, Changes& packed)
      : changes(packed),
        bytes_(bytes),
        is_plain_(bytes.size() >= kCdrHeaderBytes && bytes[0] == 0 && bytes[1] <= 1),
        swaps_(is_plain_ && bytes[1] == 0) {}

  Changes& changes;

  /// Whether the header is that of plain CDR.
  [[nodiscard]] bool is_plain() const { return is_plain_; }
  /// Bytes that were not read.
  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }

  template <Number T>
  bool operator()(const char*, T& value) {
    if (!copy(&value, 1)) return false;
    if constexpr (std::is_floating_point_v<T>) return std::isfinite(value);
    return true;
  }
  bool operator()(const char* name, bool& value) {
    std::uint8_t octet = 0;
    if (!(*this)(name, octet)) return false;
    value = octet == 1;
    return octet <= 1;
  }
  template <Enumerator E>
  bool operator()(const char* name, E& value) {
    std::underlying_type_t<E> number{};
    if (!(*this)(name, number)) return false;
    value = E{number};
    return true;
  }
  bool operator()(const char*, Vec3& v) { return copy(v.data(), 3) && v.allFinite(); }
  bool operator()(const char*, Quat& q) {
    double numbers[4];
    if (!copy(numbers, 4)) return false;
    q = Quat{numbers[0], numbers[1], numbers[2], numbers[3]};
    const double off = std::abs(q.squaredNorm() - 1.0);
    if (!(off <= kQuaternionNear)) return false;
    if (off > kQuaternionExact) q.normalize();
    return true;
  }
  bool operator()(const char*, std::array<std::uint32_t, 3>& corners) { return copy(corners.data(), 3); }
  bool operator()(const char* name, std::string& value) {
    std::uint32_t length = 0;
    if (!(*this)(name, length) || length > left()) return false;
    const char* const text = reinterpret_cast<const char*>(bytes_.data() + at_);
    at_ += length;
    value.assign(text, length > 0 && text[length - 1] == '\0' ? length - 1 : length);
    return readable(value) == value;
  }
  bool operator()(const char* name, Sequence auto& all) {
    return sequence(name, all, [this](std::size_t, auto& one) { return (*this)("", one); });
  }
  bool operator()(const char* name, Optional auto& value) {
    std::uint32_t size = 0;
    if (!(*this)(name, size) || size > 1) return false;
    value.reset();
    return size == 0 || (*this)("", value.emplace());
  }
  bool operator()(const char*, auto&& value) { return fields(*this, value); }
  bool operator()(const char* name, const auto&, auto& sent) { return (*this)(name, sent); }

  bool sequence(const char* name, auto& all, auto read) {
    std::uint32_t size = 0;
    if (!(*this)(name, size)) return false;
    for (std::size_t i = 0; i < size; ++i) {
      if (left() == 0) return false;
      if (i == all.size()) all.emplace_back();
      if (!read(i, all[i])) return false;
    }
    all.resize(size);
    return true;
  }
  bool check(bool valid) const { return valid; }

 private:
  template <class T>
  bool copy(T* to, std::size_t count) {
    const std::size_t from = at_ + ((kCdrHeaderBytes - at_) & (sizeof(T) - 1));
    if (from > bytes_.size() || bytes_.size() - from < count * sizeof(T)) return false;
    std::memcpy(to, bytes_.data() + from, count * sizeof(T));
    at_ = from + count * sizeof(T);
    for (std::size_t i = 0; swaps_ && i < count; ++i) {
      auto* const number = reinterpret_cast<std::uint8_t*>(to + i);
      std::reverse(number, number + sizeof(T));
    }
    return true;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = kCdrHeaderBytes;
  bool is_plain_, swaps_;
};

}  // namespace subworld
