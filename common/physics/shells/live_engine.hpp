#pragma once

#include "model/messages/exchange.hpp"
#include "physics/shells/engine_shell.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace subworld {

/// A body in the format that all engines share (paper 3.1).
struct HeldBody {
  Body body;  ///< as it was added, without its name
  Role role = Role::body;
  double mass = 0.0;            ///< kg, set by set_inertia()
  Vec3 inertia = Vec3::Zero();  ///< kg m^2, set by set_inertia()
  BodyState state;
  Wrench load;               ///< applied in the last step by apply_force()
  std::uint64_t loaded = 0;  ///< step in which the load acted
  std::uint64_t added = 0;   ///< number of the addition; a body that left and returned has another one
};

/// An engine filled with the contents that another one had at some time.
struct PreparedEngine {
  std::unique_ptr<Engine> engine;
  std::vector<HeldBody> holds;  ///< by id
};

/// Makes an engine and fills it. `warm_up_s` > 0: makes some steps of that length under the last loads, so that pairs,
/// memory and the solver's first guess exist before the first step that counts.
[[nodiscard]] PreparedEngine prepare_engine(const EngineSettings& settings, std::span<const Mesh> meshes,
                                            std::vector<HeldBody> content, double warm_up_s,
                                            std::span<const Joint> joints = {});

/// An engine that can be replaced by another one between two steps.
class LiveEngine final : public EngineShell {
 public:
  explicit LiveEngine(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}

  void break_joint(std::size_t joint) override;
  /// Every body in its present state, by id.
  [[nodiscard]] std::vector<HeldBody> content() const;

  /// Transfers every body with its pose and velocity to the prepared engine and uses that from now on. Takes account of
  /// all changes since the preparation. Returns the old engine. Forces for the next step are lost: call before they are
  /// applied. Throws `Error` if the new engine does not support a body that was added since.
  std::unique_ptr<Engine> exchange(PreparedEngine prepared);

  using EngineShell::add;
  void add(const Body& body, const BodyState& state, Role role) override;
  void remove(BodyId id) override;
  void remove_all(std::span<const BodyId> ids) override;
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override;
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override;
  void step_driven(double dt, std::span<const BodyId> driven, const StepDrive& drive) override;

 private:
  void stepped(double) override { ++steps_; }
  Engine& inner() const noexcept override { return *engine_; }
  std::unique_ptr<Engine> engine_;
  std::vector<std::size_t> broken_;            ///< joints
  std::vector<std::optional<HeldBody>> held_;  ///< by id; the states are in the engine
  std::uint64_t added_ = 0;
  std::uint64_t steps_ = 1;
};

}  // namespace subworld
