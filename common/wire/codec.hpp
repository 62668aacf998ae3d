#pragma once

#include "wire/topics.hpp"

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace subworld {

/// Encodes a model struct to CDR bytes (XCDR1 with its 4 byte header, as sent) and decodes it. Defined for each struct
/// that has a topic. Reuses its buffers: after the first samples of a size it allocates nothing. Not thread-safe.
template <class M>
class Codec {
 public:
  Codec();
  ~Codec();
  Codec(Codec&&) noexcept;
  Codec& operator=(Codec&&) noexcept;

  /// The bytes are valid until the next call; empty if memory ran out.
  [[nodiscard]] std::span<const std::uint8_t> encode(const M& sample) noexcept;
  /// Returns false, and leaves `sample` unchanged, if the bytes are truncated or corrupt, or the contents are invalid:
  /// numbers that are not finite, quaternions that are not unit, unknown kinds, sizes that disagree, indices out of
  /// range.
  [[nodiscard]] bool decode(std::span<const std::uint8_t> cdr, M& sample) noexcept;

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace subworld
