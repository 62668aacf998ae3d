#include "watchdog.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <fstream>

namespace subworld {

namespace {

constexpr double kStalled_s = 3.0;  // a loop in lock-step names after 2 s the peer that it waits for

std::string tail_of(const std::string& path, std::int64_t most) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) return {};
  const auto size = static_cast<std::int64_t>(file.tellg());
  const std::int64_t from = std::max<std::int64_t>(0, size - most);
  file.seekg(from);
  std::string tail(static_cast<std::size_t>(size - from), '\0');
  file.read(tail.data(), static_cast<std::streamsize>(tail.size()));
  return tail;
}

/// The last position of `part` in `text`, counted from 1; 0: none.
std::size_t last_of(const std::string& text, const char* part) {
  const std::size_t at = text.rfind(part);
  return at == std::string::npos ? 0 : at + 1;
}

}  // namespace

std::vector<std::string> Watchdog::look(const std::vector<Sighting>& programs, bool paused, double passed_s) {
  std::vector<std::string> said;
  for (const Sighting& program : programs) {
    Clock& clock = clocks_[program.label];
    const bool stalled = program.time_s >= 0.0 && program.time_s == clock.time_s && !paused;
    clock.time_s = program.time_s;
    if (!stalled) {
      if (clock.named && !paused) said.push_back(program.label + " advances again");
      clock.stalled_s = 0.0;
      clock.named = false;
      continue;
    }
    clock.stalled_s += passed_s;
    if (clock.stalled_s <= kStalled_s || !program.waits_for.empty()) continue;
    if (!clock.named) {
      said.push_back(
          fmt::format("{} has not advanced from t = {:.3f} s for {:.0f} s and waits for no peer: it is busy or stuck",
                      program.label, program.time_s, clock.stalled_s));
    }
    clock.named = true;
    if (clock.stalled_s > longest_.for_s) longest_ = {program.label, program.time_s, clock.stalled_s};
  }
  return said;
}

double last_time_s(const std::string& history) {
  const std::string tail = tail_of(history, 512);
  const auto end = tail.rfind('\n');
  if (end == std::string::npos || end == 0) return -1.0;
  const auto begin = tail.rfind('\n', end - 1);
  if (begin == std::string::npos) return -1.0;  // only the names of the columns
  return std::strtod(tail.c_str() + begin + 1, nullptr);
}

std::string waits_for(const std::string& log) {
  constexpr std::string_view kWaits = "waits for ";
  const std::string tail = tail_of(log, 16384);
  const std::size_t waits = last_of(tail, kWaits.data());
  if (waits <= last_of(tail, "is there again")) return {};
  const std::size_t from = waits - 1 + kWaits.size();
  return tail.substr(from, tail.find_first_of(";:\n", from) - from);
}

bool is_paused(const std::string& log) {
  const std::string tail = tail_of(log, 65536);
  return std::max(last_of(tail, ": paused"), last_of(tail, ": one cycle")) > last_of(tail, ": resumed");
}

}  // namespace subworld
