#pragma once

#include "wire/topics.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace subworld {

enum class Decoded : std::uint8_t {
  sample,
  invalid,     ///< truncated or corrupt, or with invalid contents
  lacks_base,  ///< changes since a message that is not here (wire/changes)
};

/// A codec of one row of `kTopicTable`; `sample` is of the row's model struct.
class AnyCodec {
 public:
  virtual ~AnyCodec() = default;
  virtual std::span<const std::uint8_t> encode(const void* sample) noexcept = 0;
  virtual Decoded decode(std::span<const std::uint8_t> cdr, void* sample) noexcept = 0;
};
[[nodiscard]] std::unique_ptr<AnyCodec> make_codec(std::size_t topic);

/// Encodes a model struct to CDR bytes (XCDR1 with its 4 byte header, as sent) and decodes it. Defined for each struct
/// that has a topic. Reuses its buffers: after the first samples of a size it allocates nothing. Remembers the frames
/// and reports that passed, to which later ones refer; so one codec serves one writer or one reader. Not thread-safe.
template <class M>
class Codec {
 public:
  /// The bytes are valid until the next call; empty if memory ran out.
  [[nodiscard]] std::span<const std::uint8_t> encode(const M& sample) noexcept { return codec_->encode(&sample); }
  /// Returns false, and leaves `sample` unchanged, if the bytes are truncated or corrupt, or the contents are invalid:
  /// numbers that are not finite, quaternions that are not unit, unknown kinds, sizes that disagree, indices out of
  /// range; or if the sample refers to one that is not here. Of a struct with another `wire_version` only that is set.
  [[nodiscard]] bool decode(std::span<const std::uint8_t> cdr, M& sample) noexcept {
    return codec_->decode(cdr, &sample) == Decoded::sample;
  }

 private:
  std::unique_ptr<AnyCodec> codec_ = make_codec(kTopicIndex<M>);
};

}  // namespace subworld
