#include "haptic_sim/loops/peer_devices.hpp"

#include <bit>

namespace subworld {

namespace {

constexpr std::uint64_t bit(std::size_t user) noexcept { return std::uint64_t{1} << user; }

}  // namespace

PeerDevices::PeerDevices(Bus& bus, const Scene& scene)
    : bus_(bus), shared_(scene.settings.mode == Mode::realtime), readers_(scene.users.size()) {
  for (const UserSpec& user : scene.users) periods_s_.push_back(shared_period_s(scene.settings, user.device.rate_hz));
}

PeerDevices::~PeerDevices() { stop(); }

void PeerDevices::stop() {
  if (!thread_.joinable()) return;
  stopped_ = true;
  asking_.release();
  thread_.join();
}

Reader<DeviceState>& PeerDevices::open(std::size_t user) {
  std::optional<Reader<DeviceState>>& reader = readers_[user];
  const std::string partition = device_partition(static_cast<int>(user));
  if (!reader) {
    reader.emplace(shared_ ? bus_.shared_device_reader(partition, periods_s_[user])
                           : bus_.reader<DeviceState>(partition));
  }
  open_.fetch_or(bit(user), std::memory_order_release);
  return *reader;
}

void PeerDevices::open_in_background() {
  thread_ = std::thread([this] { work(); });
}

Reader<DeviceState>* PeerDevices::find(std::size_t user) noexcept {
  if ((open_.load(std::memory_order_acquire) & bit(user)) != 0) return &*readers_[user];
  if ((wanted_.fetch_or(bit(user)) & bit(user)) == 0) asking_.release();
  return nullptr;
}

void PeerDevices::work() {
  std::uint64_t done = 0;
  for (asking_.acquire(); !stopped_; asking_.acquire()) {
    const std::uint64_t wanted = wanted_.load();
    for (std::uint64_t left = wanted & ~done; left != 0; left &= left - 1) {
      try {
        (void)open(static_cast<std::size_t>(std::countr_zero(left)));
      } catch (const Error& error) {
        fault_ = error.what();  // the world's account of the device goes on to count
      }
    }
    done = wanted;
  }
}

std::string PeerDevices::fault() {
  stop();
  return fault_;
}

}  // namespace subworld
