// Writes genuine messages of all topics into a folder, as a start for the codec's fuzzing: codec_seeds DIR
#include "fuzz/codec_input.hpp"
#include "support/wire_samples.hpp"
#include "wire/codec/codec.hpp"

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

namespace subworld {
namespace {

template <class M>
std::vector<std::uint8_t> writer_of(test::SampleMaker& make, std::size_t messages) {
  std::vector<std::uint8_t> input{static_cast<std::uint8_t>(kTopicIndex<M>)};
  Codec<M> codec;
  auto sample = make.make<M>();
  for (std::size_t i = 0; i < messages; ++i) {
    if constexpr (requires { sample.base_stamp; }) {
      // The later ones have changes since the first.
      if (i > 0) sample.base_stamp = sample.stamp;
      sample.stamp += i;
    }
    fuzz::append_message(input, codec.encode(sample));
  }
  return input;
}

template <class... Rows>
bool write_all(const std::string& folder, const std::tuple<Rows...>&) {
  constexpr std::uint32_t kSeeds = 8;
  bool written = true;
  const auto write = [&]<class M>(const M*, std::uint32_t seed) {
    test::SampleMaker make(seed);
    const std::vector<std::uint8_t> input = writer_of<M>(make, 1 + seed % 3);
    std::ofstream file(folder + "/" + kTopicOf<M>.name + "_" + std::to_string(seed), std::ios::binary);
    file.write(reinterpret_cast<const char*>(input.data()), static_cast<std::streamsize>(input.size()));
    written = written && file.good();
  };
  for (std::uint32_t seed = 0; seed < kSeeds; ++seed)
    (write(static_cast<const typename Rows::Model*>(nullptr), seed), ...);
  return written;
}

}  // namespace
}  // namespace subworld

int main(int argc, char** argv) {
  if (argc == 2 && subworld::write_all(argv[1], subworld::kTopicTable)) return 0;
  std::fprintf(stderr, "usage: codec_seeds DIR: a folder that can be written\n");
  return 1;
}
