// Prints the table of state hashes of the lab's in-process run, for comparison with that of another commit.
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"
#include "process/results/hash_cases.hpp"

#include <fmt/core.h>

#include <fstream>
#include <map>

namespace {

using namespace subworld;
using namespace subworld::test;

using Hashes = std::map<std::string, std::string>;  ///< hash by case

Hashes read_table(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw Error(ExitCode::usage, file + ": cannot read it; write one with: state_hashes > FILE");
  Hashes hashes;
  for (std::string line; std::getline(stream, line);) {
    const std::size_t comma = line.rfind(',');
    if (comma != std::string::npos) hashes[line.substr(0, comma)] = line.substr(comma + 1);
  }
  return hashes;
}

int main_of(int argc, char** argv) {
  std::vector<std::string> scenes;
  std::string against;
  CommandLine line(
      "state_hashes",
      "Prints the state hash of short lock-step runs: every shipped scene, three schemes, one and two users,\n"
      "with and without delay. The test StateHashes compares them with those of the real programs.");
  line.add("scene", &scenes, "names in deploy/scenes").otherwise("all");
  line.add("--against", &against, "a table of another commit: prints the differences, ends with 1 if there are any");
  line.footer(
      "Examples:\n"
      "  state_hashes > before.csv\n"
      "  state_hashes --against before.csv\n"
      "  state_hashes row heap");
  if (const auto code = line.parse(argc, argv)) return *code;
  const Hashes before = against.empty() ? Hashes{} : read_table(against);
  fmt::print("scene,scheme,users,latency_s,state_hash\n");
  int compared = 0, different = 0;
  for (const HashCase& one : hash_cases(SCENES_FOLDER, scenes)) {
    const std::string hash = in_process_hash(one, SCENES_FOLDER), name = to_text(one);
    fmt::print("{},{}\n", name, hash);
    std::fflush(stdout);
    const auto old = before.find(name);
    if (old == before.end()) continue;
    ++compared;
    different += old->second != hash;
    if (old->second != hash) fmt::print(stderr, "DIFFERS: {}, before {}\n", name, old->second);
  }
  if (against.empty()) return 0;
  fmt::print(stderr, "{} of {} hashes differ from {}\n", different, compared, against);
  return different == 0 && compared > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("state_hashes", [&] { return main_of(argc, argv); });
}
