#pragma once

#include "model/exchange.hpp"
#include "physics/engine_shell.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace subworld {

/// A body as an engine holds it, in the format that all engines share (paper 3.1).
struct HeldBody {
  Body body;  ///< as it was added, without its name
  Role role = Role::body;
  double mass = 0.0;            ///< kg, as set_inertia() left it
  Vec3 inertia = Vec3::Zero();  ///< kg m^2, likewise
  BodyState state;
  Wrench load;               ///< that acted on it in the last step, by apply_force()
  std::uint64_t loaded = 0;  ///< step in which it did
  std::uint64_t added = 0;   ///< counts the bodies added; a body that left and came back has another number
};

/// An engine that has been filled with what another one held at some time.
struct PreparedEngine {
  std::unique_ptr<Engine> engine;
  std::vector<HeldBody> holds;  ///< by id
};

/// Makes an engine and fills it. `warm_up_s` > 0: some steps of that length follow, under the loads of the last one,
/// so that pairs, memory and the solver's first guess are there before the first step that counts.
[[nodiscard]] PreparedEngine prepare_engine(const EngineSettings& settings, std::span<const Mesh> meshes,
                                            std::vector<HeldBody> content, double warm_up_s);

/// An engine that can give its place to another one between two steps.
class LiveEngine final : public EngineShell {
 public:
  explicit LiveEngine(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}

  /// Every body as it is now, by id.
  [[nodiscard]] std::vector<HeldBody> content() const;

  /// Hands every body over with its pose and velocity, whatever has come, gone or changed since the other engine was
  /// prepared, and returns the engine that went. Forces that wait for the next step are lost: call it before they are
  /// applied. Throws `Error` where the other engine cannot hold a body that came since.
  std::unique_ptr<Engine> exchange(PreparedEngine prepared);

  using EngineShell::add;
  void add(const Body& body, const BodyState& state, Role role) override;
  void remove(BodyId id) override;
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override;
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override;
  void step(double dt) override {
    engine_->step(dt);
    ++steps_;
  }

 private:
  Engine& inner() const noexcept override { return *engine_; }
  std::unique_ptr<Engine> engine_;
  std::vector<std::optional<HeldBody>> held_;  ///< by id; states are the engine's
  std::uint64_t added_ = 0;
  std::uint64_t steps_ = 1;
};

}  // namespace subworld
