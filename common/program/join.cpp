#include "program/join.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

namespace subworld {

std::string absent_text(const Wanted& wanted, const Options& options) {
  return fmt::format(
      "no {} on domain {} within {} s; start {} with the same --domain; on another host, name it with --peers and "
      "give --interface on both",
      wanted.what, options.network.domain, options.wait_s, wanted.start);
}

bool wait_for(Bus& bus, const Options& options, const Wanted& wanted, const std::function<bool()>& there,
              const std::function<bool()>& coming) {
  TimePoint hope = Clock::now();
  while (!there()) {
    if (stop_signal() != 0) return false;
    if (coming && coming()) hope = Clock::now();
    if (to_seconds(Clock::now() - hope) > options.wait_s) throw Error(ExitCode::failed, absent_text(wanted, options));
    bus.wait(0.05);
  }
  return true;
}

}  // namespace subworld
