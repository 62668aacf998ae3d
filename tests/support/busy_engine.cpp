// Bullet, but between one and two simulated seconds each step takes much longer, as where a heap falls into a scene: a
// world with it is overloaded, and then no more. It sleeps, so that the test loads nobody.
#include "physics/plugin.hpp"

#include <chrono>
#include <thread>

namespace {

using namespace subworld;

constexpr double kBusyFrom_s = 1.0, kBusyTo_s = 2.0;
constexpr std::chrono::milliseconds kBusy{20};

class BusyEngine final : public Engine {
 public:
  explicit BusyEngine(std::unique_ptr<Engine> inner) : inner_(std::move(inner)) {}

  std::string_view name() const noexcept override { return "busy"; }
  Capabilities capabilities() const noexcept override { return inner_->capabilities(); }
  using Engine::add;
  void add(const Body& body, const BodyState& state, Role role) override { inner_->add(body, state, role); }
  void remove(BodyId id) override { inner_->remove(id); }
  bool contains(BodyId id) const noexcept override { return inner_->contains(id); }
  BodyState state(BodyId id) const override { return inner_->state(id); }
  bool set_state(BodyId id, const BodyState& state) override { return inner_->set_state(id, state); }
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override {
    return inner_->set_velocity(id, linear, angular);
  }
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override { inner_->set_inertia(id, mass, inertia); }
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override {
    return inner_->apply_impulse(id, impulse, point);
  }
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override {
    return inner_->apply_force(id, force, torque);
  }
  void step(double dt) override {
    time_s_ += dt;
    if (time_s_ > kBusyFrom_s && time_s_ < kBusyTo_s) std::this_thread::sleep_for(kBusy);
    inner_->step(dt);
  }
  double part_s(double dt) const noexcept override { return inner_->part_s(dt); }
  std::span<const Contact> contacts() const noexcept override { return inner_->contacts(); }
  Box bounds(BodyId id) const override { return inner_->bounds(id); }
  void overlap(const Box& box, std::vector<BodyId>& out) const override { inner_->overlap(box, out); }
  Checkpoint checkpoint() const override { return inner_->checkpoint(); }
  void restore(const Checkpoint& checkpoint) override { inner_->restore(checkpoint); }

 private:
  std::unique_ptr<Engine> inner_;
  double time_s_ = 0.0;  ///< of settling and run
};

std::unique_ptr<Engine> make_busy(const EngineSettings& settings, std::span<const Mesh> meshes) {
  EngineSettings bullet = settings;
  bullet.name = "bullet";
  return std::make_unique<BusyEngine>(make_engine(bullet, meshes));
}

const EnginePlugin kPlugin{
    .name = "busy", .version = "of the tests", .licence = "Apache-2.0", .presets = {}, .make = make_busy};

}  // namespace

SUBWORLD_ENGINE_PLUGIN(kPlugin)
