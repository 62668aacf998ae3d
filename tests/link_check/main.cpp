// link_check [SECONDS] LINK...: whether the emulated link does what it is set to. Ends with 4 where it does not.
#include "link_check/validate.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <cstdlib>
#include <exception>

namespace {

using namespace subworld;

int check(int argc, char** argv) {
  double duration_s = argc > 1 ? std::strtod(argv[1], nullptr) : 0.0;
  const int first = duration_s > 0.0 ? 2 : 1;
  if (first == 1) duration_s = 5.0;
  std::string words;
  for (int i = first; i < argc; ++i) words += std::string(words.empty() ? "" : " ") + argv[i];
  const LinkSettings settings = parse_link(words);
  if (settings.outage.for_s > 0.0) throw Error(ExitCode::usage, "an outage is not measured");
  watch_stop_signals();
  EmulatedNetwork network;
  for (const char* host : {"a", "b"}) network.add_host(host);
  network.set_links(settings);
  network.start();
  fmt::print("{}; forwarded with {}\n", to_text(settings), network.scheduling());
  bool ok = true;
  for (const LinkValidation& one : validate(network, duration_s)) {
    fmt::print("{} -> {}:\n{}", "ab"[one.ends.from], "ab"[one.ends.to], table_of(one.checks));
    ok = ok && one.ok();
  }
  fmt::print("verdict: {}\n", ok ? "ok" : "missed; on a busy machine, end other programs and try again");
  return static_cast<int>(ok ? ExitCode::done : ExitCode::quality);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return check(argc, argv);
  } catch (const Error& wrong) {
    fmt::print(stderr, "link_check: error: {}\n", wrong.what());
    return static_cast<int>(wrong.code());
  }
}
