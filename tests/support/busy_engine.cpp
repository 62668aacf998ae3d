// Bullet, but slow on any machine. Preset `fast`: between one and two simulated seconds each step takes much longer, as
// where a heap falls into a scene; a world with it is overloaded, and then no more. It sleeps, so that the test loads
// nobody. Preset `always`: each step computes for longer than a haptic period.
#include "physics/plugin.hpp"

#include <chrono>
#include <thread>

namespace {

using namespace subworld;

constexpr double kBusyFrom_s = 1.0, kBusyTo_s = 2.0;
constexpr std::chrono::milliseconds kBusy{20};
constexpr std::chrono::microseconds kAlways{1500};

void compute_for(std::chrono::microseconds time) {
  const auto until = std::chrono::steady_clock::now() + time;
  while (std::chrono::steady_clock::now() < until) {
  }
}

class BusyEngine final : public Engine {
 public:
  BusyEngine(std::unique_ptr<Engine> inner, bool always) : inner_(std::move(inner)), always_(always) {}

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
    if (always_) {
      compute_for(kAlways);
    } else if (time_s_ > kBusyFrom_s && time_s_ < kBusyTo_s) {
      std::this_thread::sleep_for(kBusy);
    }
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
  bool always_;
  double time_s_ = 0.0;  ///< of settling and run
};

std::unique_ptr<Engine> make_busy(const EngineSettings& settings, std::span<const Mesh> meshes) {
  EngineSettings bullet = settings;
  bullet.name = "bullet";
  bullet.preset = "fast";
  return std::make_unique<BusyEngine>(make_engine(bullet, meshes), settings.preset == "always");
}

constexpr EnginePreset kPresets[] = {{.name = "fast", .what = "20 ms a step between 1 and 2 s"},
                                     {.name = "always", .what = "1.5 ms more a step"}};

const EnginePlugin kPlugin{
    .name = "busy", .version = "of the tests", .licence = "Apache-2.0", .presets = kPresets, .make = make_busy};

}  // namespace

SUBWORLD_ENGINE_PLUGIN(kPlugin)
