#include "physics/shells/engine_exchange.hpp"

#include <exception>
#include <sstream>
#include <utility>

namespace subworld {

namespace {

constexpr const char* kTargets[] = {"world", "haptic"};

}  // namespace

std::string to_text(const EngineOrder& order) {
  return std::string(kTargets[static_cast<std::size_t>(order.target)]) + " " + engine_text(order);
}

std::optional<EngineOrder> parse_engine_order(const Control& control) {
  std::istringstream words(control.argument);
  std::string target;
  EngineOrder order;
  order.number = control.number;
  std::string rest;
  if (!(words >> target >> order.engine >> order.preset) || words >> rest) return std::nullopt;
  for (const auto known : {EngineOrder::Target::world, EngineOrder::Target::haptic}) {
    if (target != kTargets[static_cast<std::size_t>(known)]) continue;
    order.target = known;
    return order;
  }
  return std::nullopt;
}

std::optional<EngineOrder> order_for_sub_worlds(const Control& control) {
  if (control.verb != ControlVerb::set_engine) return std::nullopt;
  auto order = parse_engine_order(control);
  return order && order->target == EngineOrder::Target::haptic ? order : std::nullopt;
}

EngineExchange::EngineExchange(Preparation preparation, std::vector<Mesh> meshes, std::vector<Joint> joints)
    : meshes_(std::move(meshes)), joints_(std::move(joints)) {
  if (preparation == Preparation::in_background) thread_ = std::thread([this] { work(); });
}

EngineExchange::~EngineExchange() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

std::string EngineExchange::refusal(const EngineSettings& settings) const {
  if (busy_) return "another change of engine is under way; try again";
  if (thread_.joinable()) return {};
  try {
    (void)engine_cost(settings);
  } catch (const std::exception& e) {
    return e.what();
  }
  return {};
}

bool EngineExchange::begin(const EngineSettings& settings, const LiveEngine& engine, double step_s,
                           std::uint32_t order) {
  if (busy_) return false;
  busy_ = true;
  order_ = order;
  {
    const std::lock_guard lock(mutex_);
    failure_.clear();
    ready_.reset();
  }
  Job job{settings, engine.content(), step_s};
  if (!thread_.joinable()) {
    prepare(job);
    return true;
  }
  {
    const std::lock_guard lock(mutex_);
    job_ = std::move(job);
  }
  wake_.notify_one();
  return true;
}

void EngineExchange::prepare(Job& job) {
  std::optional<PreparedEngine> ready;
  std::string failure;
  try {
    ready = prepare_engine(job.settings, meshes_, std::move(job.content), job.step_s, joints_);
  } catch (const std::exception& e) {
    failure = e.what();
  }
  const std::lock_guard lock(mutex_);
  ready_ = std::move(ready);
  failure_ = std::move(failure);
}

void EngineExchange::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return stop_ || job_ || gone_; });
    if (stop_) return;
    std::unique_ptr<Engine> gone = std::move(gone_);
    std::optional<Job> job = std::exchange(job_, std::nullopt);
    lock.unlock();
    gone.reset();
    if (job) prepare(*job);
    lock.lock();
  }
}

bool EngineExchange::poll(LiveEngine& engine) {
  if (!busy_) return false;
  std::optional<PreparedEngine> ready;
  {
    // The loop never waits: if the lock is not free, it tries again before the next step.
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return false;
    if (!ready_) {
      busy_ = failure_.empty();
      return false;
    }
    ready = std::exchange(ready_, std::nullopt);
  }
  busy_ = false;
  std::unique_ptr<Engine> gone;
  try {
    gone = engine.exchange(std::move(*ready));
  } catch (const std::exception& e) {
    const std::lock_guard lock(mutex_);
    failure_ = e.what();
    return false;
  }
  if (thread_.joinable()) {
    {
      const std::lock_guard lock(mutex_);
      gone_ = std::move(gone);
    }
    wake_.notify_one();
  }
  return true;
}

std::string EngineExchange::take_failure() {
  if (busy_) return {};
  const std::unique_lock lock(mutex_, std::try_to_lock);
  return lock.owns_lock() ? std::exchange(failure_, {}) : std::string();
}

}  // namespace subworld
