// Bullet, but slow on any machine. Preset `fast`: between one and two simulated seconds each step takes much longer, as
// if a heap fell into the scene, so that the world is overloaded for a while. The engine sleeps instead of computing,
// so that the test does not load the machine. Preset `always`: each step computes for longer than a haptic period.
#include "physics/plugin.hpp"
#include "physics/shells/engine_shell.hpp"

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

class BusyEngine final : public EngineShell {
 public:
  BusyEngine(std::unique_ptr<Engine> inner, bool always) : inner_(std::move(inner)), always_(always) {}

  std::string_view name() const noexcept override { return "busy"; }
  void stepped(double dt) override {
    time_s_ += dt;
    if (always_) {
      compute_for(kAlways);
    } else if (time_s_ > kBusyFrom_s && time_s_ < kBusyTo_s) {
      std::this_thread::sleep_for(kBusy);
    }
  }

 private:
  Engine& inner() const noexcept override { return *inner_; }
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
