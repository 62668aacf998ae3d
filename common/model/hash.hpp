#pragma once

#include <cstdint>

namespace subworld {

/// FNV-1a of 64 bits: begin with `kHashSeed` and add one part after the other. Equal on every machine.
inline constexpr std::uint64_t kHashSeed = 0xcbf29ce484222325U;
inline constexpr std::uint64_t kHashPrime = 0x100000001b3U;
[[nodiscard]] constexpr std::uint64_t hashed(std::uint64_t hash, std::uint64_t part) noexcept {
  return (hash ^ part) * kHashPrime;
}

/// SplitMix64 (Steele, Lea, Flood 2014): random bits of a key, equal on every machine. The standard library's
/// distributions are not. For a sequence, add `kRandomStep` to the key.
inline constexpr std::uint64_t kRandomStep = 0x9e3779b97f4a7c15U;
[[nodiscard]] constexpr std::uint64_t random_bits(std::uint64_t key) noexcept {
  key += kRandomStep;
  key = (key ^ (key >> 30U)) * 0xbf58476d1ce4e5b9U;
  key = (key ^ (key >> 27U)) * 0x94d049bb133111ebU;
  return key ^ (key >> 31U);
}

}  // namespace subworld
