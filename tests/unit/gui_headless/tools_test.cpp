#include "live/tools.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <limits>
#include <optional>
#include <utility>

namespace subworld::live {
namespace {

using Bytes = std::vector<std::uint8_t>;
using std::chrono::milliseconds;

/// Of no run on this machine.
int own_domain() { return 1000 + getpid(); }

/// The socket of a device.
class ToolDevice {
 public:
  explicit ToolDevice(int user) {
    const LocalAddress own = tool_address(own_domain(), user);
    EXPECT_EQ(bind(socket_, own.get(), own.size), 0);
  }
  ~ToolDevice() { close(socket_); }
  ToolDevice(const ToolDevice&) = delete;
  ToolDevice& operator=(const ToolDevice&) = delete;

  std::optional<PoseDatagram> receive() const {
    PoseDatagram came{};
    if (recv(socket_, &came, sizeof came, 0) != sizeof came) return std::nullopt;
    return came;
  }

 private:
  int socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
};

struct Sent {
  double x_m = 0.0, w = 1.0;
  std::uint32_t buttons = 0;
  bool held = true;
};

Bytes cdr_of(const Sent& sent) {
  Bytes cdr(4 + 61);
  cdr[1] = 1;
  std::memcpy(&cdr[4], &sent.x_m, 8);
  std::memcpy(&cdr[4 + 24], &sent.w, 8);
  std::memcpy(&cdr[4 + 56], &sent.buttons, 4);
  cdr[4 + 60] = sent.held ? 1 : 0;
  return cdr;
}

/// User and holder of each tool that is offered.
std::vector<std::pair<std::uint32_t, std::uint32_t>> shown(Tools& tools) {
  const auto cdr = tools.state();
  std::vector<std::uint32_t> words((cdr.size() - 4) / 4);
  std::memcpy(words.data(), cdr.data() + 4, cdr.size() - 4);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> all;
  for (std::uint32_t i = 0; i < words.at(0); ++i) all.emplace_back(words.at(1 + 2 * i), words.at(2 + 2 * i));
  return all;
}

using Shown = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

class ToolsOfARun : public ::testing::Test {
 protected:
  [[nodiscard]] std::string move(int user, std::uint32_t connection, const Sent& sent = {}) {
    return tools_.move(user, connection, cdr_of(sent), now_);
  }
  Tools tools_{own_domain(), 3};
  Tools::Clock::time_point now_ = Tools::Clock::now();
};

TEST_F(ToolsOfARun, AreThoseOfDevicesThatAreThere) {
  EXPECT_EQ(shown(tools_), Shown{});
  EXPECT_NE(move(1, 5).find("--device browser"), std::string::npos);
  {
    const ToolDevice device(1);
    tools_.inspect(now_);
    EXPECT_EQ(shown(tools_), (Shown{{1, 0}}));
    EXPECT_EQ(move(1, 5), "");
    EXPECT_EQ(shown(tools_), (Shown{{1, 5}}));
  }
  EXPECT_NE(move(1, 5).find("has ended"), std::string::npos);
  EXPECT_EQ(move(1, 5), "") << "said once";
  EXPECT_EQ(shown(tools_), Shown{});
  const ToolDevice again(1);
  tools_.inspect(now_);
  EXPECT_EQ(shown(tools_), (Shown{{1, 0}}));
}

TEST_F(ToolsOfARun, BelongToOneConnectionAtATime) {
  const ToolDevice device(0);
  EXPECT_EQ(move(0, 5, {.x_m = 0.1, .buttons = 3}), "");
  const auto came = device.receive();
  ASSERT_TRUE(came);
  EXPECT_EQ(came->mark, kPoseMark);
  EXPECT_EQ(came->position_m[0], 0.1);
  EXPECT_EQ(came->orientation[0], 1.0);
  EXPECT_EQ(came->buttons, 3U);
  EXPECT_EQ(came->flags, 0U);
  EXPECT_NE(move(0, 6).find("another page"), std::string::npos);
  EXPECT_FALSE(device.receive());
  EXPECT_EQ(move(0, 6, {.held = false}), "") << "not its own: without effect";
  EXPECT_FALSE(device.receive());
  EXPECT_EQ(move(0, 5, {.held = false}), "");
  EXPECT_EQ(device.receive().value_or(PoseDatagram{}).flags, kReleased);
  EXPECT_EQ(move(0, 6), "");
  const auto next = device.receive();
  ASSERT_TRUE(next);
  EXPECT_GT(next->number, came->number);
}

TEST_F(ToolsOfARun, AreReleasedByAConnectionThatClosesOrSendsNothing) {
  const ToolDevice first(0), second(1);
  EXPECT_EQ(move(0, 5), "");
  EXPECT_EQ(move(1, 5), "");
  EXPECT_EQ(shown(tools_), (Shown{{0, 5}, {1, 5}}));
  now_ += milliseconds(600);
  EXPECT_EQ(move(1, 5), "");
  now_ += milliseconds(600);
  tools_.inspect(now_);
  EXPECT_EQ(shown(tools_), (Shown{{0, 0}, {1, 5}}));
  tools_.release(5);
  EXPECT_EQ(shown(tools_), (Shown{{0, 0}, {1, 0}}));
  for (const ToolDevice* device : {&first, &second}) {
    std::optional<PoseDatagram> last;
    while (const auto came = device->receive()) last = came;
    EXPECT_EQ(last.value_or(PoseDatagram{}).flags, kReleased);
  }
}

TEST_F(ToolsOfARun, RefuseNonsense) {
  const ToolDevice device(0);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const Sent& bad : {Sent{.x_m = kNan}, Sent{.w = kNan}, Sent{.w = 0.9}, Sent{.x_m = 2.1}, Sent{.x_m = -1e300}})
    EXPECT_NE(move(0, 5, bad), "");
  EXPECT_NE(move(-1, 5), "");
  EXPECT_NE(move(3, 5), "");
  for (const std::size_t size : {0U, 3U, 4U, 64U, 69U, 1000U}) {
    Bytes cdr = cdr_of({});
    cdr.resize(size);
    EXPECT_NE(tools_.move(0, 5, cdr, now_), "") << size;
  }
  EXPECT_FALSE(device.receive());
  EXPECT_EQ(move(0, 6), "") << "none of them has taken the tool";
}

// A device that does not read fills its socket.
TEST_F(ToolsOfARun, NeverWait) {
  const ToolDevice device(0);
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(move(0, 5), "");
  EXPECT_TRUE(device.receive());
}

}  // namespace
}  // namespace subworld::live
