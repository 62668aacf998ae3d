// The decoders of all topics, with messages of any bytes. What a decoder accepts has finite numbers only, and survives
// being sent on: encoded and decoded again it is the same, bit by bit.
#include "fuzz/codec_input.hpp"
#include "support/wire_samples.hpp"
#include "wire/codec/codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace subworld {
namespace {

void require(bool holds, const char* topic, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "topic %s: %s\n", topic, what);
  std::abort();
}

bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

template <class M>
void decode(std::span<const std::uint8_t> input) {
  const char* const topic = kTopicOf<M>.name;
  Codec<M> codec;
  M sample;
  while (const auto message = fuzz::next_message(input)) {
    if (!codec.decode(*message, sample)) continue;
    if constexpr (requires { sample.wire_version; }) {
      if (sample.wire_version != kWireVersion) continue;  // it is only named
    }
    const std::vector<double> numbers = test::numbers_of(sample);
    require(std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); }), topic, "a number is not finite");
    M complete = sample, again;
    if constexpr (requires { complete.base_stamp; }) complete.base_stamp.reset();
    Codec<M> another;
    const auto bytes = another.encode(complete);
    require(!bytes.empty() && Codec<M>{}.decode(bytes, again), topic, "an accepted message is refused when sent on");
    require(std::ranges::equal(test::numbers_of(complete), test::numbers_of(again), same_bits), topic,
            "an accepted message changes when sent on");
  }
}

template <class... Rows>
void decode(std::size_t topic, std::span<const std::uint8_t> input, const std::tuple<Rows...>&) {
  std::size_t row = 0;
  ((row++ == topic ? decode<typename Rows::Model>(input) : void()), ...);
}

}  // namespace
}  // namespace subworld

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  subworld::decode(data[0] % subworld::kTopics.size(), {data + 1, size - 1}, subworld::kTopicTable);
  return 0;
}
