#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "record/replay.hpp"
#include "tools.hpp"

namespace {

using namespace subworld;

void add_options(CommandLine& line, ReplayRequest& request) {
  line.add("file", &request.file, "recording, as `subworld run --record` writes it").required();
  line.flag("--resimulate", request.resimulate,
            "run the recorded scene again with the recorded settings, and compare the state hashes; of a recording "
            "in lock-step");
  line.add("--repair", &request.repair,
           "file for a complete copy of a recording that has no end, because its recorder was killed")
      .otherwise("none is written");
  line.flag("--publish", request.publish,
            "publish the recorded messages through DDS, in the place of the programs that were recorded");
  line.flag("--page", request.page, "the same, with a display that serves the page; prints the address");
  add_live_options(line, request.live,
                   "publish the recording, and serve it to Lichtblick and Foxglove on this TCP port");
  line.add("--speed", &request.speed, "simulated time per time").range(kLeastReplaySpeed, kMostReplaySpeed);
  line.add("--from", &request.from_s, "first moment, simulated time").range(0.0, 1e6, "s");
  line.flag("--paused", request.paused, "begin paused: `subworld control step` advances to the next snapshot");
  add_dds(line, request.network.dds, {"fastdds", "cyclonedds"});
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("the first from 100 down to 60 that no other run on this host uses");
  add_network(line, request.network);
  line.add("--out", &request.out, "folder for the results").otherwise("a new out/replay-TIME");
  line.footer(
      "Examples:\n"
      "  subworld replay run.mcap\n"
      "  subworld replay run.mcap --resimulate\n"
      "  subworld replay run.mcap --repair whole.mcap\n"
      "  subworld replay run.mcap --page --speed 0.5\n"
      "  subworld replay run.mcap --publish --paused --domain 100\n"
      "Without an option it prints what the file holds.\n"
      "Exit codes: 0 done, 1 the state hashes differ, 2 usage or no recording.");
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld replay", about_tool("replay"));
  ReplayRequest request;
  add_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  check_live_options(request.live);
  return replay(request);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld replay",
                            subworld::guarded("subworld replay", [&] { return main_of(argc, argv); }));
}
