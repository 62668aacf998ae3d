#pragma once

#include "model/error.hpp"
#include "wire/take.hpp"

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <string_view>

namespace subworld {

/// Waits for the next sample, and marks the loop's stages `wake`, until it was received, and `decode`. False when
/// `stopped` says so. Throws `Error` (failed) with `gone` when all writers of a reader that had one have been silent
/// for a second of this process's own time, so that neither a busy machine nor one that was halted is taken for a dead
/// peer.
template <class M, class Stages>
bool await(Bus& bus, Reader<M>& reader, M& sample, Stages& stages, const std::function<bool()>& stopped,
           std::string_view gone) {
  using namespace std::chrono_literals;
  using WallClock = std::chrono::steady_clock;
  WallClock::duration silent{};
  const auto came = [&] { return take(reader, sample, stages, Stages::Stage::wake) == Take::sample; };
  for (auto last = WallClock::now();;) {
    if (came()) return true;
    if (stopped()) return false;
    bus.wait(0.05);
    const auto now = WallClock::now();
    silent += std::min<WallClock::duration>(now - last, 100ms);
    last = now;
    if (reader.alive_writers() > 0) {
      silent = {};
    } else if (silent > 1s) {
      if (came()) return true;
      throw Error(ExitCode::failed, std::string(gone));
    }
  }
}

}  // namespace subworld
