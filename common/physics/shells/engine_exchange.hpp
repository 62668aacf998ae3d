#pragma once

#include "physics/shells/live_engine.hpp"

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace subworld {

/// The order `set_engine`: which engine is exchanged for which, and the order's number.
struct EngineOrder {
  enum class Target : std::uint8_t { world, haptic };
  Target target = Target::world;
  std::string engine;
  std::string preset = "fast";
  std::uint32_t number = 0;
};
/// The argument, without the number.
[[nodiscard]] std::string to_text(const EngineOrder& order);
/// Engine and preset, as in "ode fast".
[[nodiscard]] inline std::string engine_text(const EngineOrder& order) { return order.engine + " " + order.preset; }
/// Empty if the argument is not in the format of to_text().
[[nodiscard]] std::optional<EngineOrder> parse_engine_order(const Control& control);
/// The order to change the engine of the sub-worlds; empty: it is another order.
[[nodiscard]] std::optional<EngineOrder> order_for_sub_worlds(const Control& control);

/// Exchanges a live engine while a loop runs. A thread of its own makes and fills the new engine. When it is ready, it
/// replaces the old one between two steps. The thread also destroys the old one.
class EngineExchange {
 public:
  enum class Preparation : std::uint8_t {
    at_once,        ///< in begin(): lock-step, independent of wall time
    in_background,  ///< real time
  };
  /// A new thread inherits the scheduling of its creator: construct before the loop requests real-time scheduling.
  EngineExchange(Preparation preparation, std::vector<Mesh> meshes, std::vector<Joint> joints = {});
  ~EngineExchange();
  EngineExchange(const EngineExchange&) = delete;
  EngineExchange& operator=(const EngineExchange&) = delete;

  /// Why there is no exchange for this engine now; empty: it can begin. In the background, an unknown engine or preset
  /// fails later.
  [[nodiscard]] std::string refusal(const EngineSettings& settings) const;
  /// Starts an exchange; `step_s` is the step of the engine, `order` the number of the requesting order. Returns false
  /// while one is in progress.
  bool begin(const EngineSettings& settings, const LiveEngine& engine, double step_s, std::uint32_t order = 0);
  /// Call between two steps, before forces are applied. Replaces the engine if the new one is ready, and then returns
  /// true. Does not throw or block.
  bool poll(LiveEngine& engine);
  /// Why the last exchange failed, reported once; empty otherwise. The old engine stays in use.
  [[nodiscard]] std::string take_failure();
  /// Number of the order of the latest exchange.
  [[nodiscard]] std::uint32_t order() const noexcept { return order_; }

 private:
  struct Job {
    EngineSettings settings;
    std::vector<HeldBody> content;
    double step_s = 0.0;
  };
  void prepare(Job& job);
  void work();

  std::vector<Mesh> meshes_;
  std::vector<Joint> joints_;
  bool busy_ = false;  ///< of the loop only, like the next member
  std::uint32_t order_ = 0;

  std::mutex mutex_;  ///< guards the following; held for a short time only
  std::condition_variable wake_;
  std::optional<Job> job_;
  std::optional<PreparedEngine> ready_;
  std::unique_ptr<Engine> gone_;
  std::string failure_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace subworld
