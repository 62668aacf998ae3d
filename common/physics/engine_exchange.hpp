#pragma once

#include "physics/live_engine.hpp"

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace subworld {

/// Which engine is to be exchanged for which: the argument of the order `set_engine`, and that order's number.
struct EngineOrder {
  enum class Target : std::uint8_t { world, haptic };
  Target target = Target::world;
  std::string engine;
  std::string preset = "fast";
  std::uint32_t number = 0;
};
/// Without the number.
[[nodiscard]] std::string to_text(const EngineOrder& order);
/// Empty where the argument is none of to_text()'s.
[[nodiscard]] std::optional<EngineOrder> parse_engine_order(const Control& control);

/// Exchanges a live engine for another one while a loop runs: the new one is made and filled on a thread of its own,
/// and takes over between two steps when it is ready; the old one is taken down on that thread too.
class EngineExchange {
 public:
  enum class Preparation : std::uint8_t {
    at_once,        ///< in begin(): lock-step, where nobody looks at a clock
    in_background,  ///< real time
  };
  /// A thread takes the scheduling of the one that makes it: construct before the loop asks for real time.
  EngineExchange(Preparation preparation, std::vector<Mesh> meshes);
  ~EngineExchange();
  EngineExchange(const EngineExchange&) = delete;
  EngineExchange& operator=(const EngineExchange&) = delete;

  /// Starts an exchange; `step_s` is the step that the engine will be asked for, `order` the number of who asked.
  /// Returns false while one is under way.
  bool begin(const EngineSettings& settings, const LiveEngine& engine, double step_s, std::uint32_t order = 0);
  /// Between two steps, before forces are applied: hands over when the new engine is ready. True when it did. Does not
  /// throw, does not wait.
  bool poll(LiveEngine& engine);
  /// Why the last exchange came to nothing, told once; empty otherwise. The old engine goes on.
  [[nodiscard]] std::string take_failure();
  /// Of the exchange that was last begun.
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
  bool busy_ = false;  ///< of the loop alone, like the next
  std::uint32_t order_ = 0;

  std::mutex mutex_;  ///< guards what follows; held for moments only
  std::condition_variable wake_;
  std::optional<Job> job_;
  std::optional<PreparedEngine> ready_;
  std::unique_ptr<Engine> gone_;
  std::string failure_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace subworld
