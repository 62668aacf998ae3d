#pragma once

#include "model/error.hpp"
#include "wire/bus.hpp"

#include <chrono>
#include <functional>
#include <string>

namespace subworld {

/// Waits for the next sample. False when `stopped` says so. Throws `Error` (failed) with `gone` when all writers of a
/// reader that had one have been silent for a second, so that a busy machine is not taken for a dead peer.
template <class M>
bool await(Bus& bus, Reader<M>& reader, M& sample, const std::function<bool()>& stopped, const std::string& gone) {
  const auto now = [] { return std::chrono::steady_clock::now(); };
  auto heard = now();
  while (true) {
    if (reader.take(sample) == Take::sample) return true;
    if (stopped()) return false;
    bus.wait(0.05);
    if (reader.alive_writers() > 0) {
      heard = now();
    } else if (now() - heard > std::chrono::seconds(1) && reader.take(sample) != Take::sample) {
      throw Error(ExitCode::failed, gone);
    }
  }
}

}  // namespace subworld
