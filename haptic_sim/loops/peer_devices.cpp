#include "haptic_sim/loops/peer_devices.hpp"

#include <bit>

namespace subworld {

namespace {

constexpr std::uint64_t bit(std::size_t user) noexcept { return std::uint64_t{1} << user; }

}  // namespace

bool AllDevices::receive(std::size_t user) {
  for (DeviceState came; waiting_[user].empty() && reader_.receive();) {
    if (reader_.decode(came) && came.device < waiting_.size() && came.device != own_)
      waiting_[came.device].push_back(came);
  }
  return !waiting_[user].empty();
}

bool AllDevices::Of::decode(DeviceState& state) {
  state = all_.waiting_[user_].front();
  all_.waiting_[user_].pop_front();
  return true;
}

PeerDevices::PeerDevices(Bus& bus, const Scene& scene) : bus_(bus), readers_(scene.users.size()) {
  for (const UserSpec& user : scene.users) periods_s_.push_back(shared_period_s(scene.settings, user.device.rate_hz));
}

PeerDevices::~PeerDevices() { stop(); }

void PeerDevices::stop() {
  if (!thread_.joinable()) return;
  stopped_ = true;
  asking_.release();
  thread_.join();
}

void PeerDevices::open(std::size_t user) {
  readers_[user].emplace(bus_.shared_device_reader(device_partition(static_cast<int>(user)), periods_s_[user]));
  open_.fetch_or(bit(user), std::memory_order_release);
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
        open(static_cast<std::size_t>(std::countr_zero(left)));
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
