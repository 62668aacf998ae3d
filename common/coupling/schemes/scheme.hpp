#pragma once

#include "coupling/schemes/sub_world_side.hpp"
#include "coupling/schemes/world_side.hpp"
#include "coupling/sync/authority.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

namespace subworld {

/// What the programs, the plan, the command line and the lab need to know of a scheme: data.
struct SchemeProperties {
  std::string_view name;
  std::string_view summary;  ///< one line, for people
  /// False: the proxy lives in the world alone; nothing is selected, extracted or corrected.
  bool has_sub_worlds = true;
  /// The sub-world's engine simulates bodies of the border: they count in the budget of bodies.
  bool simulates_border = false;
  /// A sub-world moves the proxies of other users by their devices; else they are bodies as any.
  bool replicates_peers = false;
  /// The world takes over islands that several sub-worlds hold wholly (coupling/sync/shared_islands).
  bool merges_shared_islands = false;
  /// The correction weighs the impulses of all contacts, friction included, and the whole border.
  bool weighs_impulses = false;
  /// The sub-world's share of a correction is spread over the cycle; else it is made at once.
  bool corrects_gradually = false;
  /// Cycles by which the sub-world runs ahead. 0: both simulate the same cycle at the same time. 1: the world simulates
  /// a cycle when it knows what the user did in it.
  int lead_cycles = 0;
  /// Late messages make it create energy.
  bool creates_energy_late = false;
  /// Longest step of the world's engine, s, where the scene does not say how many sub-steps it makes.
  double longest_world_step_s = INFINITY;
};

/// Which part of the difference each copy of a body is moved, 0 .. 1.
struct Correction {
  double world = 0.0;
  double sub = 0.0;
  double world_turn = world;  ///< of orientation and angular velocity, in place of `world`
};

/// The two copies of one body when they are made one.
struct CopyPair {
  Owner owner = Owner::world;
  double lag_cycles = 0.0;         ///< age of the world's state when the sub-world uses it; infinite: it has none yet
  double report_lag_cycles = 0.0;  ///< age of the newest frame that the sub-world had used when it reported
  /// The tool has six degrees of freedom, and the sub-world holds no other user's proxy.
  bool turns_alone = false;

  [[nodiscard]] bool is_proxy() const noexcept { return owner == Owner::user || owner == Owner::peer; }
};

/// A coupling scheme: its properties and its two sides. The programs ask, they do not know which one runs. A scheme is
/// one folder beside this file and one row of the table in scheme.cpp.
struct Scheme {
  SchemeProperties properties;
  /// Pure: both processes feed it the same and correct alike. It may throw nothing, and its parts are finite.
  Correction (*correction)(const CopyPair& pair, const Indicators& indicators, const Settings& settings) noexcept;
  std::unique_ptr<WorldSide> (*make_world_side)(const Scene& scene);
  /// Null without sub-worlds. `remembered_cycles`: how far back stamps are asked for.
  std::unique_ptr<SubWorldSide> (*make_sub_world_side)(const Scene& scene, std::uint64_t remembered_cycles);
  /// Whether what only this scheme reads in a frame fits the scene. Here: a scheme that reads no ghosts has none.
  bool (*accepts)(const WorldFrame& frame, const Scene& scene) noexcept =
      [](const WorldFrame& frame, const Scene&) noexcept { return frame.ghosts.empty() && frame.ghost_peers.empty(); };
};

/// All there are, by name.
[[nodiscard]] std::span<const Scheme* const> schemes();
/// Adds one from outside this folder, which must live as long as the program; before any scene is loaded. Throws
/// `Error` (usage) for one without a name, with that of another one, or without one of its functions.
void add_scheme(const Scheme& scheme);
/// The one of the settings. Throws `Error` (usage) for an unknown name, naming `where` it stands and those that exist.
[[nodiscard]] const Scheme& scheme_of(const Settings& settings, std::string_view where = "--scheme or settings.scheme");

}  // namespace subworld
