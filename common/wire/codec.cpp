#include "wire/codec.hpp"

#include "wire/convert.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <cstring>
#include <exception>
#include <utility>

namespace subworld {
namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

constexpr std::size_t kHeaderBytes = 4;
constexpr std::size_t kMostPadding = 3;

template <class M>
struct WireType;
template <>
struct WireType<SceneDescription> {
  using Type = msg::Scene;
};
template <>
struct WireType<DeviceState> {
  using Type = msg::DeviceState;
};
template <>
struct WireType<DeviceCommand> {
  using Type = msg::DeviceCommand;
};
template <>
struct WireType<WorldFrame> {
  using Type = msg::WorldFrame;
};
template <>
struct WireType<HapticReport> {
  using Type = msg::HapticReport;
};
template <>
struct WireType<WorldSnapshot> {
  using Type = msg::WorldState;
};
template <>
struct WireType<Control> {
  using Type = msg::Control;
};
template <>
struct WireType<Status> {
  using Type = msg::Status;
};

/// Plain CDR, either byte order.
bool known_encapsulation(std::span<const std::uint8_t> cdr) {
  return cdr.size() >= kHeaderBytes && cdr[0] == 0 && cdr[1] <= 1;
}

}  // namespace

template <class M>
struct Codec<M>::Scratch {
  typename WireType<M>::Type wire;
  M sample;
  std::vector<std::uint8_t> bytes;
};

namespace {

constexpr std::size_t kUsualBytes = 1U << 17U;  // of a message with kUsualMembers bodies

void make_room(msg::WorldFrame& frame) {
  frame.members().reserve(kUsualMembers);
  frame.fixed_bodies().reserve(kUsualMembers);
  frame.islands().reserve(kUsualMembers);
  frame.entering().reserve(kUsualMembers);
  frame.states().reserve(kUsualMembers);
  frame.border().reserve(4 * kUsualMembers);
  frame.ghosts().reserve(kUsualMembers);
  frame.ghost_axes().reserve(kMostGhostAxes * kUsualMembers);
  frame.carried_bodies().reserve(kUsualMembers);
  frame.suppression().reserve(1);
}

void make_room(msg::HapticReport& report) {
  report.members().reserve(kUsualMembers);
  report.islands().reserve(kUsualMembers);
  report.device().reserve(1);
}

}  // namespace

template <class M>
Codec<M>::Codec() : scratch_(std::make_unique<Scratch>()) {
  // Messages of the loops get their memory at the start; others allocate when needed.
  if constexpr (requires { reserve(scratch_->sample, kUsualMembers); }) {
    reserve(scratch_->sample, kUsualMembers);
    make_room(scratch_->wire);
    scratch_->bytes.reserve(kUsualBytes);
  }
}
template <class M>
Codec<M>::~Codec() = default;
template <class M>
Codec<M>::Codec(Codec&&) noexcept = default;
template <class M>
Codec<M>& Codec<M>::operator=(Codec&&) noexcept = default;

template <class M>
std::span<const std::uint8_t> Codec<M>::encode(const M& sample) noexcept {
  using Wire = typename WireType<M>::Type;
  try {
    to_wire(sample, scratch_->wire);
    auto& bytes = scratch_->bytes;
    bytes.resize(kHeaderBytes + Wire::getCdrSerializedSize(scratch_->wire));
    FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
    Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    cdr.serialize_encapsulation();
    scratch_->wire.serialize(cdr);
    return {bytes.data(), cdr.getSerializedDataLength()};
  } catch (const std::exception&) {
    return {};
  }
}

template <class M>
bool Codec<M>::decode(std::span<const std::uint8_t> bytes, M& sample) noexcept {
  using Wire = typename WireType<M>::Type;
  if (!known_encapsulation(bytes)) return false;
  try {
    // Fast CDR takes a mutable buffer but only reads from it here.
    FastBuffer buffer(const_cast<char*>(reinterpret_cast<const char*>(bytes.data())), bytes.size());
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    cdr.read_encapsulation();
    scratch_->wire.deserialize(cdr);
    if (bytes.size() - cdr.getSerializedDataLength() <= kMostPadding &&
        from_wire(std::as_const(scratch_->wire), scratch_->sample)) {
      std::swap(sample, scratch_->sample);
      return true;
    }
  } catch (const std::exception&) {
    // A corrupt length may have enlarged the sequences.
    scratch_->wire = Wire{};
  }
  return false;
}

template class Codec<SceneDescription>;
template class Codec<DeviceState>;
template class Codec<DeviceCommand>;
template class Codec<WorldFrame>;
template class Codec<HapticReport>;
template class Codec<WorldSnapshot>;
template class Codec<Control>;
template class Codec<Status>;

}  // namespace subworld
