#include "wire/codec/codec.hpp"

#include "wire/codec/cdr.hpp"
#include "wire/codec/changes.hpp"

#include <exception>
#include <tuple>
#include <utility>
#include <vector>

namespace subworld {
namespace {

constexpr std::size_t kMostPadding = 3;
constexpr std::size_t kUsualBytes = 1U << 17U;  // of a message with kUsualMembers bodies

template <class Model>
class CodecOf final : public AnyCodec {
 public:
  CodecOf() {
    // Messages of the loops get their memory at the start; others allocate when needed.
    if constexpr (kHasBase) {
      reserve(sample_, kUsualMembers);
      bytes_.reserve(kUsualBytes);
      Base nothing;
      subworld::pack(sample_, {nullptr, &nothing}, changes_);
    }
  }

  std::span<const std::uint8_t> encode(const void* sample) noexcept override {
    try {
      const Model& model = *static_cast<const Model*>(sample);
      if constexpr (kHasBase) pack(model);
      CdrWriter archive(bytes_, changes_);
      fields(archive, model);
      return archive.written();
    } catch (const std::exception&) {
      return {};
    }
  }

  Decoded decode(std::span<const std::uint8_t> bytes, void* sample) noexcept override {
    try {
      CdrReader archive(bytes, changes_);
      if (!archive.is_plain()) return Decoded::invalid;
      if constexpr (requires { sample_.wire_version; }) {
        CdrReader head = archive;
        std::uint32_t version = 0;
        for (std::uint32_t words = 0; words <= kTopicOf<Model>.key_words; ++words) {
          if (!head("", version)) return Decoded::invalid;
        }
        if (version != kWireVersion) {
          *static_cast<Model*>(sample) = Model{};
          static_cast<Model*>(sample)->wire_version = version;
          return Decoded::sample;
        }
      }
      if (!fields(archive, sample_) || archive.left() > kMostPadding) return Decoded::invalid;
      if constexpr (kHasBase) {
        if (const Decoded unpacked = unpack(); unpacked != Decoded::sample) return unpacked;
      }
      std::swap(*static_cast<Model*>(sample), sample_);
      return Decoded::sample;
    } catch (const std::exception&) {
      return Decoded::invalid;  // memory ran out
    }
  }

 private:
  static constexpr bool kHasBase = requires(Model m) { m.base_stamp; };

  void pack(const Model& sample) {
    MessageIdentity identity = identity_of(sample);
    identity.stamp = sample.base_stamp.value_or(identity.stamp);
    const bool older = identity.stamp < sample.stamp;
    subworld::pack(sample, {older ? sent_.find(identity) : nullptr, &sent_.next()}, changes_);
    sent_.keep();
  }

  Decoded unpack() {
    MessageIdentity identity = identity_of(sample_);
    const Base* base = nullptr;
    if (changes_.base_stamp != sample_.stamp) {
      identity.stamp = changes_.base_stamp;
      base = received_.find(identity);
      if (base == nullptr) return Decoded::lacks_base;
    }
    if (!subworld::unpack(changes_, {base, &received_.next()}, sample_)) return Decoded::invalid;
    received_.keep();
    return Decoded::sample;
  }

  Changes changes_;
  Bases sent_, received_;
  Model sample_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace

std::unique_ptr<AnyCodec> make_codec(std::size_t topic) {
  return std::apply(
      [&]<class... Models>(const Topic<Models>&...) {
        std::unique_ptr<AnyCodec> made;
        std::size_t row = 0;
        (void)((row++ == topic && (made = std::make_unique<CodecOf<Models>>())) || ...);
        return made;
      },
      kTopicTable);
}

}  // namespace subworld
