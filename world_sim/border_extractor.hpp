#pragma once

#include "coupling/approach.hpp"
#include "coupling/contact_graph.hpp"
#include "coupling/ghost.hpp"
#include "coupling/scheme.hpp"
#include "coupling/selection.hpp"
#include "coupling/timetable.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "physics/resting_engine.hpp"

#include <functional>
#include <memory>
#include <span>

namespace subworld {

/// The world at one stamp, as frames are made from it.
struct WorldNow {
  std::uint64_t stamp = 0;
  double stamp_s = 0.0;
  double cycle_s = 0.0;  ///< length of the cycle that ended here
  const Timetable& timetable;
  const RestingEngine& engine;
  const std::span<const Contact>& contacts;    ///< totals over the last cycle
  const std::function<bool()>& find_friction;  ///< of the contacts; false where it was there
  const ContactGraph& graph;                   ///< of the contacts
  std::span<const Motion> motions;             ///< by body
};

/// One user's sub-world within it.
struct Inside {
  const Membership& membership;
  Box reach;                                  ///< of the members, until a sub-world hears again
  double horizon_s = 0.0;                     ///< how long this frame will be all that the sub-world knows
  const std::function<bool(BodyId)>& shared;  ///< whether other sub-worlds hold the body as well
};

/// What a frame tells of the border, as the scheme's sub-world wants it.
class BorderExtractor {
 public:
  virtual ~BorderExtractor() = default;
  /// Fills `border`, and ghosts and islands of the frame.
  virtual void extract(const WorldNow& now, const Inside& inside, std::vector<BoundaryContact>& border,
                       WorldFrame& frame) = 0;
};

[[nodiscard]] std::unique_ptr<BorderExtractor> make_border_extractor(const Scheme& scheme, const Scene& scene);

}  // namespace subworld
