#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "tools.hpp"
#include "watch/top.hpp"

namespace {

using namespace subworld;

void add_options(CommandLine& line, TopRequest& request) {
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("all that programs of this machine use");
  add_dds(line, request.network.dds, {"fastdds", "cyclonedds"});
  add_network(line, request.network);
  line.flag("--once", request.once, "print one table and end; so it does where the output is no terminal");
  line.footer(
      "Examples:\n"
      "  subworld top\n"
      "  subworld top --once\n"
      "  subworld top --domain 70 --interface eth0 --peers 10.0.0.2\n"
      "q or Ctrl-C ends. MISSED are deadlines, in brackets those by the OS; FACTOR is the world's real-time factor.");
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld top", about_tool("top"));
  TopRequest request;
  add_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  show_top(request);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld top", subworld::guarded("subworld top", [&] { return main_of(argc, argv); }));
}
