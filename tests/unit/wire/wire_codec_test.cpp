#include "support/wire_samples.hpp"
#include "wire/codec/codec.hpp"
#include "wire/codec/readable.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace subworld {
namespace {

using test::numbers_of;
using test::SampleMaker;

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) {
           return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
         });
}

template <class M>
class WireCodec : public ::testing::Test {};

template <class... Rows>
::testing::Types<typename Rows::Model...> models_of(const std::tuple<Rows...>&);
using Topics = decltype(models_of(kTopicTable));

struct TopicName {
  template <class M>
  static std::string GetName(int) {
    return kTopicOf<M>.name;
  }
};

TYPED_TEST_SUITE(WireCodec, Topics, TopicName);

TYPED_TEST(WireCodec, round_trip_keeps_every_bit) {
  Codec<TypeParam> sender;
  Codec<TypeParam> receiver;
  TypeParam received;
  SampleMaker make(7);
  for (int round = 0; round < 200; ++round) {
    const auto sent = make.template make<TypeParam>();
    const auto bytes = sender.encode(sent);
    ASSERT_GT(bytes.size(), 4U);
    ASSERT_TRUE(receiver.decode(bytes, received)) << "round " << round;
    ASSERT_TRUE(same_bits(numbers_of(sent), numbers_of(received))) << "round " << round;
  }
}

TYPED_TEST(WireCodec, default_sample_travels) {
  Codec<TypeParam> codec;
  TypeParam received;
  const auto bytes = codec.encode(TypeParam{});
  EXPECT_TRUE(codec.decode(bytes, received));
}

TYPED_TEST(WireCodec, truncated_samples_are_rejected_and_leave_the_target_alone) {
  Codec<TypeParam> codec;
  SampleMaker make(11);
  const auto encoded = codec.encode(make.template make<TypeParam>());
  const std::vector<std::uint8_t> whole(encoded.begin(), encoded.end());
  auto target = make.template make<TypeParam>();
  const auto before = numbers_of(target);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::uint8_t> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    ASSERT_FALSE(codec.decode(cut, target)) << size << " of " << whole.size() << " bytes";
  }
  EXPECT_TRUE(same_bits(before, numbers_of(target)));
  EXPECT_TRUE(codec.decode(whole, target));
}

TYPED_TEST(WireCodec, corrupt_bytes_never_give_numbers_that_are_not_finite) {
  Codec<TypeParam> codec;
  SampleMaker make(13);
  const auto encoded = codec.encode(make.template make<TypeParam>());
  const std::vector<std::uint8_t> whole(encoded.begin(), encoded.end());
  TypeParam target;
  int rejected = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int with : {0x00, 0x01, 0x7f, 0x80, 0xff}) {
      auto bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(with);
      if (!codec.decode(bytes, target)) ++rejected;
      for (const double number : numbers_of(target)) ASSERT_TRUE(std::isfinite(number)) << "byte " << at;
    }
  }
  EXPECT_GT(rejected, 0);
}

TYPED_TEST(WireCodec, foreign_encapsulations_are_rejected) {
  Codec<TypeParam> codec;
  const auto encoded = codec.encode(TypeParam{});
  std::vector<std::uint8_t> bytes(encoded.begin(), encoded.end());
  TypeParam target;
  for (const int kind : {2, 3, 6, 7, 8, 9, 255}) {
    bytes[1] = static_cast<std::uint8_t>(kind);
    EXPECT_FALSE(codec.decode(bytes, target)) << kind;
  }
}

TYPED_TEST(WireCodec, trailing_bytes_are_rejected_but_padding_is_not) {
  Codec<TypeParam> codec;
  const auto encoded = codec.encode(TypeParam{});
  std::vector<std::uint8_t> bytes(encoded.begin(), encoded.end());
  TypeParam target;
  bytes.resize(bytes.size() + 3);
  EXPECT_TRUE(codec.decode(bytes, target));
  bytes.resize(bytes.size() + 5);
  EXPECT_FALSE(codec.decode(bytes, target));
}

/// True if the sample can be encoded and decoded.
template <class M>
bool accepted(const M& sample) {
  Codec<M> codec;
  M received;
  return codec.decode(codec.encode(sample), received);
}

template <class M>
void expect_only_the_version_of(M sample) {
  Codec<M> codec;
  const auto sent = codec.encode(sample);
  std::vector<std::uint8_t> bytes(sent.begin(), sent.end());
  bytes.resize(bytes.size() / 2);  // another version has another layout
  bytes[4 + 4 * kTopicOf<M>.key_words] ^= 1;
  M received = sample;
  EXPECT_TRUE(codec.decode(bytes, received));
  EXPECT_EQ(received.wire_version, kWireVersion ^ 1U);
  sample = {};
  sample.wire_version = kWireVersion ^ 1U;
  EXPECT_TRUE(same_bits(numbers_of(received), numbers_of(sample)));
}

TEST(WireVersion, of_a_sample_of_another_version_nothing_else_is_known) {
  SampleMaker make(11);
  expect_only_the_version_of(make.make<SceneDescription>());
  expect_only_the_version_of(make.make<Status>());
}

TEST(WireValidation, numbers_must_be_finite) {
  SampleMaker make(17);
  for (const double bad : {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    auto state = make.make<DeviceState>();
    state.linear_velocity.y() = bad;
    EXPECT_FALSE(accepted(state));
    auto frame = make.make<WorldFrame>();
    frame.start_in_s = bad;
    EXPECT_FALSE(accepted(frame));
    auto status = make.make<Status>();
    status.rate_hz = bad;
    EXPECT_FALSE(accepted(status));
  }
}

TEST(WireValidation, texts_are_readable) {
  const std::string good = "caf\u00e9 \u20ac \U0001f600\n\tend";
  EXPECT_EQ(readable(good), good);
  EXPECT_EQ(readable("\x1b[2J|\x7f|\xff|\xc0\x80|\xed\xa0\x80|\xf4\x90\x80\x80|\xe2\x82"), "?[2J|?|?|??|???|????|??");
  EXPECT_EQ(readable(std::string_view("a\0b", 3)), "a?b");
  Codec<ControlReply> codec;
  ControlReply sent, received;
  sent.answer.text = "a\x1b";
  const auto bytes = codec.encode(sent);
  std::vector<std::uint8_t> whole(bytes.begin(), bytes.end());
  ASSERT_TRUE(codec.decode(whole, received)) << "the writer makes it readable";
  EXPECT_EQ(received.answer.text, "a?");
  *std::ranges::find(whole, static_cast<std::uint8_t>('?')) = 0x1b;
  EXPECT_FALSE(codec.decode(whole, received)) << "a foreign writer may not";
}

TEST(WireValidation, quaternions_are_unit_normalised_when_near_and_rejected_when_not) {
  DeviceState state;
  state.pose.orientation.coeffs() *= 1.001;
  Codec<DeviceState> codec;
  DeviceState received;
  ASSERT_TRUE(codec.decode(codec.encode(state), received));
  EXPECT_NEAR(received.pose.orientation.norm(), 1.0, 1e-12);
  state.pose.orientation.coeffs() *= 1.1;
  EXPECT_FALSE(accepted(state));
  state.pose.orientation.coeffs().setZero();
  EXPECT_FALSE(accepted(state));
}

TEST(WireValidation, kinds_out_of_range_are_rejected) {
  Control control;
  control.verb = static_cast<ControlVerb>(10);
  EXPECT_FALSE(accepted(control));
  Status status;
  status.program = static_cast<ProgramKind>(4);
  EXPECT_FALSE(accepted(status));
  WorldFrame frame;
  frame.entering.resize(1);
  EXPECT_TRUE(accepted(frame));
  frame.entering[0].body.shape.kind = static_cast<ShapeKind>(8);
  EXPECT_FALSE(accepted(frame));
}

TEST(WireValidation, bodies_must_be_possible) {
  WorldFrame frame;
  frame.entering.resize(1);
  Body& body = frame.entering[0].body;
  body.mass = -1.0;
  EXPECT_FALSE(accepted(frame));
  body.mass = 1.0;
  body.material.restitution = 1.5;
  EXPECT_FALSE(accepted(frame));
  body.material.restitution = 0.0;
  body.inertia.x() = -1.0;
  EXPECT_FALSE(accepted(frame));
}

TEST(WireValidation, inertia_must_be_positive_definite) {
  WorldFrame frame;
  frame.ghosts.resize(1);
  frame.ghosts[0].mass_kg = 1.0;
  CarriedBody& carried = frame.ghosts[0].carried.emplace();
  carried.mass_kg = 1.0;
  carried.inertia_kg_m2.setIdentity();
  EXPECT_TRUE(accepted(frame));
  carried.inertia_kg_m2(0, 1) = carried.inertia_kg_m2(1, 0) = 2.0;
  EXPECT_FALSE(accepted(frame));
  carried.inertia_kg_m2.setIdentity();
  carried.mass_kg = 0.0;
  EXPECT_FALSE(accepted(frame));
}

TEST(WireValidation, sizes_and_indices_of_a_scene_must_agree) {
  const auto good = SampleMaker(19).make<SceneDescription>();
  ASSERT_TRUE(accepted(good));
  auto scene = good;
  scene.states.emplace_back();
  EXPECT_FALSE(accepted(scene));
  scene = good;
  scene.bodies[0].shape.mesh = static_cast<std::uint32_t>(scene.meshes.size());
  EXPECT_FALSE(accepted(scene));
  scene = good;
  scene.meshes[0].triangles[0][2] = static_cast<std::uint32_t>(scene.meshes[0].vertices.size());
  EXPECT_FALSE(accepted(scene));
}

}  // namespace
}  // namespace subworld
