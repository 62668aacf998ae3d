#pragma once

#include "io/results/json.hpp"
#include "lab/coupling/measure.hpp"
#include "lab/latency/limit.hpp"
#include "lab/latency/search.hpp"
#include "lab/page/tables.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// The link whose delay is searched.
enum class Link : std::uint8_t {
  world,     ///< between world and sub-world, in lock-step in one process
  device,    ///< between device and sub-world, likewise
  emulated,  ///< as world, but over an emulated network link: the real programs in real time
};
[[nodiscard]] const char* name_of(Link link) noexcept;
/// "round-trip delay", "device delay", "round-trip delay of an emulated link".
[[nodiscard]] const char* words_of(Link link) noexcept;

/// What is asked about one scene.
struct LatencyQuestion {
  Point point;  ///< without its delays
  Link link = Link::world;
  std::string dds = "fastdds";  ///< vendor of an emulated link, or mixed
  Criteria bounds = default_bounds();
  double largest_s = 0.5;
  DelayRange range;  ///< its `largest` is computed from largest_s
  int starts = 4;    ///< instants in a cycle of the world at which the paths begin
  std::uint64_t seed = 1;
};

/// What was measured at one delay.
struct DelayedRun {
  double delay_s = 0.0;
  int starts = 0;               ///< runs, each with another start of the paths
  std::vector<Criteria> users;  ///< the largest of all starts, by user
  std::string disturbed = {};   ///< over a link: how this machine disturbed the best run; empty: it did not
};

struct LatencyAnswer {
  std::vector<Criteria> reference;  ///< errors of the reference, by user; 0 where a criterion has none
  std::vector<DelayedRun> runs;     ///< by rising delay
  std::vector<UserLimit> limits;    ///< by user
  Json settings;                    ///< columns that all rows have
  std::string sentence;
  bool finished = true;
  std::string disturbed = {};  ///< why nothing can be concluded from a run beyond the bounds, which ended the search
};

/// Called after each delay, with the most delays that the search may take.
using OnRun = std::function<void(const LatencyAnswer&, const DelayedRun&, std::size_t most)>;

/// " with 5 ms of jitter and 1 % of loss"; empty: neither.
[[nodiscard]] std::string disturbance_of(const Json& settings);

/// Searches the limit of each user (latency/search). Each direction of the link has half of the delay, in whole haptic
/// steps. A delay that is within the bounds, but nearer to them than half, is run with all starts, and the largest
/// values count: the error depends on where in a cycle a contact begins. Stops early, with what there is, where a
/// signal asks for it. Throws `Error` (usage) for a scene that cannot be run.
[[nodiscard]] LatencyAnswer answer(const LatencyQuestion& question, References& references, const OnRun& on_run);

/// Draws the instants in a cycle at which all paths begin, and the shift of the grid of delays: two seeds are two
/// independent measurements.
void scatter(LatencyQuestion& question, std::uint64_t seed);

/// A row for each run and user, and one for the limit of each user.
[[nodiscard]] Rows rows_of(const LatencyQuestion& question, const LatencyAnswer& answer);

}  // namespace subworld
