#include "doctor/doctor.hpp"
#include "io/options.hpp"
#include "io/output.hpp"
#include "tools.hpp"

namespace {

using namespace subworld;

void add_options(CommandLine& line, doctor::Request& request) {
  line.add("scene", &request.scene, "scene that is to run: its users and engines are examined too").otherwise("none");
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("that of the run on this machine");
  add_dds(line, request.dds, {"fastdds", "cyclonedds", "mixed"});
  add_network(line, request.network);
  line.add("--qos", &request.network.qos_file, "the DDS vendor's settings file")
      .otherwise("the vendor's environment variable, else qos/VENDOR.xml beside the programs");
  line.add("--out", &request.out, "folder for results of a run").otherwise("out");
  line.flag("--verbose", request.verbose, "also list all checks, and what was measured");
  line.flag("--json", request.json, "print one JSON object: healthy, checks, findings, remarks");
  line.footer(
      "Examples:\n"
      "  subworld doctor\n"
      "  subworld doctor heap --domain 70 --verbose\n"
      "  subworld doctor --domain 70 --interface eth0 --peers 10.0.0.2\n"
      "Each finding has a cure: a command for the shell that the doctor was started from.\n"
      "Exit codes: 0 healthy, 4 something was found, 2 usage or scene.");
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld doctor", about_tool("doctor"));
  doctor::Request request;
  add_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  return doctor::run(request);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld doctor",
                            subworld::guarded("subworld doctor", [&] { return main_of(argc, argv); }));
}
