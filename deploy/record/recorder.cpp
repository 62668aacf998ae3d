#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "io/results/replacing.hpp"
#include "record/recording.hpp"
#include "tools.hpp"

#include <fmt/core.h>
#include <unistd.h>

namespace {

using namespace subworld;

/// Records the programs of this host until the input ends. The first line of its output has its process, and for each
/// program the place of its messages.
void record(const Options& options, bool display) {
  check_replaced("--record", options.record, kRecordingBegin);
  const Scene scene = load_scene(options);
  MessageMemory memory(sizes_of_messages(scene, display, true),
                       {.recorded = true, .waits = scene.settings.mode == Mode::lockstep, .keeps_to_itself = true});
  Recording recording(options.record, {scene, settings_flags_of(options), "", display}, memory);
  recording.start();
  fmt::print("{}", getpid());
  for (std::size_t i = 0; i < places_of_messages(scene.settings.users); ++i) {
    const std::string place = memory.place_of(i);
    fmt::print(" {}", place.empty() ? "-" : place);
  }
  fmt::print("\n");
  std::fflush(stdout);
  char ignored = 0;
  while (read(STDIN_FILENO, &ignored, 1) > 0) {
  }
  (void)recording.drain();
  recording.finish_part();
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld recorder", about_tool("recorder"));
  Options options;
  bool display = false;
  add_run_options(line, options);
  add_record_option(line, options);
  line.flag("--gui", display, "with the display");
  line.footer("`subworld up --record FILE` starts it on hosts that ssh reaches, and merges their files.");
  if (const auto code = line.parse(argc, argv)) return *code;
  record(options, display);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld recorder",
                            subworld::guarded("subworld recorder", [&] { return main_of(argc, argv); }));
}
