// The reader of checkpoints, with files of any bytes behind a right length and checksum. It accepts a file, which is
// then written again as the same bytes, or names the file and what is wrong with it.
#include "model/error.hpp"
#include "world_sim/checkpoint/checkpoint.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "%s\n", what);
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // What is fuzzed is what the head and the checksum guard.
  std::string bytes;
  subworld::encode({}, bytes);
  constexpr std::size_t kHeadBytes = 32, kSumBytes = 8;
  bytes.resize(kHeadBytes);
  bytes.append(reinterpret_cast<const char*>(data), size);
  bytes.append(kSumBytes, '\0');
  subworld::seal_checkpoint(bytes);
  try {
    const subworld::WorldCheckpoint checkpoint = subworld::decode_checkpoint(bytes, "FILE");
    std::string again;
    subworld::encode(checkpoint, again);
    require(again == bytes, "another file is written than was read");
  } catch (const subworld::Error& wrong) {
    require(wrong.code() == subworld::ExitCode::failed, "a wrong checkpoint is a failure");
    require(std::string(wrong.what()).starts_with("FILE: "), wrong.what());
  }
  return 0;
}
