#pragma once

#include "model/error.hpp"
#include "wire/bus.hpp"

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>

namespace subworld {

/// Waits for the next sample. False when `stopped` says so. Throws `Error` (failed) with `gone` when all writers of a
/// reader that had one have been silent for a second of this process's own time, so that neither a busy machine nor one
/// that was halted is taken for a dead peer.
template <class M>
bool await(Bus& bus, Reader<M>& reader, M& sample, const std::function<bool()>& stopped, const std::string& gone) {
  using namespace std::chrono_literals;
  using WallClock = std::chrono::steady_clock;
  WallClock::duration silent{};
  for (auto last = WallClock::now();;) {
    if (reader.take(sample) == Take::sample) return true;
    if (stopped()) return false;
    bus.wait(0.05);
    const auto now = WallClock::now();
    silent += std::min<WallClock::duration>(now - last, 100ms);
    last = now;
    if (reader.alive_writers() > 0) {
      silent = {};
    } else if (silent > 1s && reader.take(sample) != Take::sample) {
      throw Error(ExitCode::failed, gone);
    }
  }
}

}  // namespace subworld
