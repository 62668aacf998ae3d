// The reader of scenes, with files of any text. It accepts a file, or names its place and what is wrong there.
#include "model/error.hpp"
#include "model/scene/scene.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

/// A file in memory that is written anew for each input.
int file_number() {
  static const int number = memfd_create("scene", 0);
  return number;
}

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "%s\n", what);
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  require(ftruncate(file_number(), 0) == 0 && pwrite(file_number(), data, size, 0) == static_cast<ssize_t>(size),
          "no file in memory");
  const std::string file = "/proc/self/fd/" + std::to_string(file_number());
  try {
    const subworld::Scene scene = subworld::load_scene(file);
    require(scene.bodies.size() == scene.initial.size(), "a body has no state");
  } catch (const subworld::Error& wrong) {
    require(wrong.code() == subworld::ExitCode::usage, "a wrong scene is a usage error");
    require(std::string(wrong.what()).starts_with(file + ":"), wrong.what());
  }
  return 0;
}
