#pragma once

#include "coupling/schemes/reduced/ghost_model.hpp"
#include "coupling/schemes/reduced/ghost_motion.hpp"
#include "coupling/schemes/sub_world_side.hpp"
#include "coupling/sync/gradual_shifts.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "physics/engine.hpp"

#include <optional>
#include <vector>

namespace subworld {

/// Whether the scene has all ghosts of a frame, and whether each can be as it is said to be.
[[nodiscard]] bool ghosts_fit(const WorldFrame& frame, const Scene& scene) noexcept;

/// The outside bodies that touch a sub-world, or soon may, as its engine sees them: their real shapes, which meet
/// members, and the loose ones also other ghosts, and move by their reduced models along their axes, by the world's
/// states across them; or, carried by the inside alone, as the rigid bodies that they are.
class Ghosts final : public SubWorldSide {
 public:
  Ghosts(const Scene& scene, std::uint64_t remembered_cycles);

  /// Ghosts that come and go, models, and the error in their own ways.
  void follow(const WorldFrame& frame, Engine& engine, const Following& how) override;
  [[nodiscard]] std::optional<BodyState> release(BodyId id, Engine& engine) override;
  void clear(Engine& engine) override;
  void begin(Engine& engine, double dt, double operators_n, std::span<const PeerPull> peers) override;
  void end(const Engine& engine, double dt) override;
  void log(std::uint64_t stamp, const Engine& engine) override;

  [[nodiscard]] std::size_t size() const noexcept { return ghosts_.size(); }

 private:
  struct Logged {
    std::uint64_t stamp = 0;
    bool written = false;
    BodyState state;
  };
  struct Ghost {
    BodyId id{};
    GhostMotion motion;
    std::uint64_t world_stamp = 0;              ///< of the frame used last
    std::optional<CarriedMotion> carried = {};  ///< in the place of `motion`
    Vec3 spin = Vec3::Zero();                   ///< the world's, rad/s
    Vec6 start = Vec6::Zero();                  ///< velocity with which the step under way began
    double mass_kg = 0.0;                       ///< in the engine, of a ghost that is not carried
    std::vector<Logged> log;
  };

  [[nodiscard]] std::vector<Logged> empty_log();
  /// Takes one out, keeps its log's memory and returns the next.
  std::vector<Ghost>::iterator drop(std::vector<Ghost>::iterator ghost, Engine& engine);
  /// The body as the engine is to have it.
  [[nodiscard]] Body as_ghost(const GhostModel& model) const;
  /// Where a ghost begins.
  [[nodiscard]] BodyState start_of(const GhostModel& model, const BodyState& world, const WorldFrame& frame,
                                   const Engine& engine, double lag_s) const;
  void create(const GhostModel& model, const BodyState& world, const WorldFrame& frame, Engine& engine, double lag_s);
  /// A state along the axes, the world's across them.
  [[nodiscard]] static BodyState constrained(const GhostMotion& motion, const BodyState& own, const BodyState& world,
                                             double lag_s);
  /// Makes a ghost follow a new model.
  void adapt(Ghost& ghost, const GhostModel& model, Engine& engine);
  /// Whether one copy met an impact sooner than the other, since the frame used last. Its timing is no error of the
  /// velocity: to correct it would give the ghost, and by now what it pushes as well, the impact once more or take it
  /// back.
  [[nodiscard]] bool impact_is_due(const Ghost& ghost, const BodyState& world, const WorldFrame& frame) const;
  /// The springs of the peers behind a ghost, for a step.
  void attach(Ghost& ghost, const BodyState& now, double dt, std::span<const PeerPull> peers) const;
  void correct(Ghost& ghost, const BodyState& world, const WorldFrame& frame, Engine& engine, const Following& how);

  const Scene& scene_;
  std::uint64_t remembered_;
  std::vector<Ghost> ghosts_;  ///< by id
  std::vector<GhostPeer> peers_;
  GradualShifts gradual_;
  std::uint64_t logged_ = 0;                     ///< latest stamp in the logs
  std::vector<std::vector<Logged>> spare_logs_;  ///< of ghosts that have gone: a loop does not allocate
};

}  // namespace subworld
