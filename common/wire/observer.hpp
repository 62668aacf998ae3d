#pragma once

#include "wire/backend.hpp"
#include "wire/bus.hpp"
#include "wire/codec/codec.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace subworld {

/// Readers and writers of the bytes of one topic, with their CDR header. They must not outlive their bus. One thread at
/// a time. `topic` is a row of `kTopicTable`. Both throw `Error` (middleware).
class Observer {
 public:
  /// Reads for a viewer, in any thread: best effort, volatile and without a deadline in both modes. No writer waits for
  /// it, what it misses is no event of the run, and it wakes no loop: its owner polls. Of each key it holds the newest
  /// `kNewestOfSeveral`.
  [[nodiscard]] static std::unique_ptr<wire::BackendReader> reader(const Bus& bus, std::size_t topic,
                                                                   const std::string& partition);
  /// Writes in the place of a program, to those who would observe it, without waiting. It offers late joiners the
  /// newest samples, in both modes.
  [[nodiscard]] static std::unique_ptr<wire::BackendWriter> counterpart(const Bus& bus, std::size_t topic,
                                                                        const std::string& partition);
};

/// Reads a topic as `Observer::reader` does, decoded.
template <class M>
class Watched {
 public:
  Watched(const Bus& bus, const std::string& partition)
      : reader_(Observer::reader(bus, kTopicIndex<M>, partition)), codec_(make_codec(kTopicIndex<M>)) {}
  /// The oldest sample not yet taken. False, and `message` unchanged, if there is none. Does not block.
  bool take(M& message) {
    std::uint64_t writer = 0;
    while (reader_->take(bytes_, writer))
      if (codec_->decode(bytes_, &message) == Decoded::sample) return true;
    return false;
  }

 private:
  std::unique_ptr<wire::BackendReader> reader_;
  std::unique_ptr<AnyCodec> codec_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace subworld
