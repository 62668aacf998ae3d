#pragma once

#include "model/error.hpp"
#include "model/hash.hpp"

// One of these two, as CMake found the library: what differs between the versions, with the same names.
#ifdef SUBWORLD_FASTDDS_3
#include "wire/fastdds/version_3.hpp"
#else
#include "wire/fastdds/version_2.hpp"
#endif

#include <fmt/core.h>
#include <fastdds/dds/common/InstanceHandle.hpp>
#include <fastdds/dds/core/policy/QosPolicies.hpp>

#include <cmath>
#include <cstdint>
#include <string>

/// What all files of this back end use.
namespace subworld::wire::fast {

inline constexpr int kMostKeys = 256;  // as many as `is_known_key` accepts

[[noreturn]] inline void fail(const std::string& message) { throw Error(ExitCode::middleware, "Fast DDS: " + message); }

template <class Entity>
Entity* require(Entity* entity, const std::string& what) {
  if (entity == nullptr) fail(fmt::format("no {}; see its log lines above", what));
  return entity;
}

inline Duration_t duration(double seconds) {
  if (std::isinf(seconds)) return c_TimeInfinite;
  const double whole = std::floor(seconds);
  return {static_cast<std::int32_t>(whole), static_cast<std::uint32_t>((seconds - whole) * 1e9)};
}

/// The 16 bytes of a handle as one number.
inline std::uint64_t number_of(const dds::InstanceHandle_t& handle) noexcept {
  std::uint64_t number = kHashSeed;
  for (int i = 0; i < 16; ++i) number = hashed(number, handle.value[i]);
  return number;
}
inline std::uint64_t number_of(const rtps::GuidPrefix_t& participant) noexcept {
  std::uint64_t number = kHashSeed;
  for (const auto byte : participant.value) number = hashed(number, byte);
  return number;
}

}  // namespace subworld::wire::fast
