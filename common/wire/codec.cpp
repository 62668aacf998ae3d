#include "wire/codec.hpp"

#include "wire/convert.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <array>
#include <exception>
#include <tuple>
#include <utility>
#include <vector>

namespace subworld {
namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

constexpr std::size_t kHeaderBytes = 4;
constexpr std::size_t kMostPadding = 3;
constexpr std::size_t kUsualBytes = 1U << 17U;  // of a message with kUsualMembers bodies

/// Plain CDR, either byte order.
bool known_encapsulation(std::span<const std::uint8_t> cdr) {
  return cdr.size() >= kHeaderBytes && cdr[0] == 0 && cdr[1] <= 1;
}

template <class Model, class Wire>
class CodecOf final : public AnyCodec {
 public:
  CodecOf() {
    // Messages of the loops get their memory at the start; others allocate when needed.
    if constexpr (requires { reserve(sample_, kUsualMembers); }) {
      reserve(sample_, kUsualMembers);
      bytes_.reserve(kUsualBytes);
      Base nothing;
      ToWire{{nullptr, &nothing}}(sample_, wire_);
    }
  }

  std::span<const std::uint8_t> encode(const void* sample) noexcept override {
    try {
      to_wire(*static_cast<const Model*>(sample));
      bytes_.resize(kHeaderBytes + Wire::getCdrSerializedSize(wire_));
      FastBuffer buffer(reinterpret_cast<char*>(bytes_.data()), bytes_.size());
      Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
      cdr.serialize_encapsulation();
      wire_.serialize(cdr);
      return {bytes_.data(), cdr.getSerializedDataLength()};
    } catch (const std::exception&) {
      return {};
    }
  }

  Decoded decode(std::span<const std::uint8_t> bytes, void* sample) noexcept override {
    if (!known_encapsulation(bytes)) return Decoded::invalid;
    try {
      // Fast CDR takes a mutable buffer but only reads from it here.
      FastBuffer buffer(const_cast<char*>(reinterpret_cast<const char*>(bytes.data())), bytes.size());
      Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
      cdr.read_encapsulation();
      if constexpr (requires { sample_.wire_version; }) {
        Cdr::state begin = cdr.getState();
        std::uint32_t version = 0;
        for (std::uint32_t words = 0; words <= kTopicOf<Model>.key_words; ++words) cdr >> version;
        if (version != kWireVersion) {
          *static_cast<Model*>(sample) = Model{};
          static_cast<Model*>(sample)->wire_version = version;
          return Decoded::sample;
        }
        cdr.setState(begin);
      }
      wire_.deserialize(cdr);
      if (bytes.size() - cdr.getSerializedDataLength() > kMostPadding) return Decoded::invalid;
      const Decoded decoded = from_wire();
      if (decoded == Decoded::sample) std::swap(*static_cast<Model*>(sample), sample_);
      return decoded;
    } catch (const std::exception&) {
      // A corrupt length may have enlarged the sequences.
      wire_ = Wire{};
    }
    return Decoded::invalid;
  }

 private:
  static constexpr bool kHasBase = requires(Model m) { m.base_stamp; };

  void to_wire(const Model& sample) {
    if constexpr (kHasBase) {
      MessageIdentity identity = identity_of(sample);
      identity.stamp = sample.base_stamp.value_or(identity.stamp);
      const bool older = identity.stamp < sample.stamp;
      ToWire{{older ? sent_.find(identity) : nullptr, &sent_.next()}}(sample, wire_);
      sent_.keep();
    } else {
      ToWire{}(sample, wire_);
    }
  }

  Decoded from_wire() {
    if constexpr (kHasBase) {
      const Base* base = nullptr;
      if (wire_.base_stamp() != wire_.stamp()) {
        base = received_.find(base_of(wire_));
        if (base == nullptr) return Decoded::lacks_base;
      }
      if (!FromWire{{base, &received_.next()}}(sample_, std::as_const(wire_))) return Decoded::invalid;
      received_.keep();
      return Decoded::sample;
    } else {
      return FromWire{}(sample_, std::as_const(wire_)) ? Decoded::sample : Decoded::invalid;
    }
  }

  Wire wire_;
  Bases sent_, received_;
  Model sample_;
  std::vector<std::uint8_t> bytes_;
};

template <class M, class W>
std::unique_ptr<AnyCodec> make(const Topic<M, W>&) {
  return std::make_unique<CodecOf<M, W>>();
}

}  // namespace

std::unique_ptr<AnyCodec> make_codec(std::size_t topic) {
  return std::apply(
      [&](const auto&... rows) {
        std::unique_ptr<AnyCodec> made;
        std::size_t row = 0;
        (void)((row++ == topic && (made = make(rows))) || ...);
        return made;
      },
      kTopicTable);
}

}  // namespace subworld
