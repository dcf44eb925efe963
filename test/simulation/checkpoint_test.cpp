#include "brash_ice_rig/simulation/checkpoint.h"

#include <sys/stat.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../effects/effect_bench.h"
#include "../output/temporary_directory.h"
#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "brash_ice_rig/system/hash.h"

namespace brash_ice_rig {
namespace {

/// 4.8 x 4.8 m, 1024 particles of soft ice, which takes long steps: what is compared here are bits.
Scenario lift() {
  Scenario s = smallLift();
  s.field.length_x_m = s.field.length_y_m = 4.8;
  s.solver.stiffness_scale = 1.0e-4;
  s.load_cell.noise_n = 20.0;
  s.load_cell.lag_s = 0.05;
  return s;
}

class Checkpoint : public ::testing::Test {
 protected:
  /// Readings and hashes of the time after an instant, with and without a stop there.
  void expectSameFuture(const Scenario& scenario, double before_s, double after_s, int threads_after = 1) {
    Simulation whole(scenario);
    if (before_s > 0.0) whole.advance(before_s);
    whole.save(file_);
    CheckpointReader file(file_);
    Simulation resumed = Simulation::load(file, threads_after);
    EXPECT_EQ(resumed.stateHash(), whole.stateHash());
    expectSame(resumed, whole);
    for (int k = 0; k < static_cast<int>(after_s / whole.samplePeriod() + 0.5); ++k) {
      whole.advance(whole.samplePeriod());
      resumed.advance(whole.samplePeriod());
      ASSERT_EQ(resumed.snapshot().load_cell_force_n, whole.snapshot().load_cell_force_n) << "sample " << k;
    }
    EXPECT_FALSE(whole.frozen());
    EXPECT_EQ(resumed.stateHash(), whole.stateHash());
    expectSame(resumed, whole);
  }

  static void expectSame(const Simulation& a, const Simulation& b) {
    const Snapshot of_a = a.snapshot(), of_b = b.snapshot();
    EXPECT_EQ(of_a.time_s, of_b.time_s);
    EXPECT_EQ(of_a.stage, of_b.stage);
    EXPECT_EQ(of_a.tension_n, of_b.tension_n);
    EXPECT_EQ(of_a.flags.bits(), of_b.flags.bits());
    EXPECT_EQ(of_a.rig.fold_ratio, of_b.rig.fold_ratio);
    EXPECT_EQ(of_a.rig.hoist_position_m, of_b.rig.hoist_position_m);
    EXPECT_EQ(a.activeParticleSteps(), b.activeParticleSteps());
    ASSERT_EQ(of_a.energy.has_value(), of_b.energy.has_value());
    if (!of_a.energy) return;
    for (const EnergyTerm& term : kEnergyTerms) {
      EXPECT_EQ((*of_a.energy).*term.value, (*of_b.energy).*term.value) << term.name;
    }
  }

  TemporaryDirectory directory_;
  std::string file_ = directory_.file("checkpoint.bin");
};

TEST_F(Checkpoint, ResumeIsTheUninterruptedRunToTheLastBitFromAnyInstant) {
  // At the start, while settling, in the middle of a sample period, while the plug tears.
  for (const double before_s : {0.0, 0.2, 0.503, 1.2}) {
    SCOPED_TRACE(before_s);
    expectSameFuture(lift(), before_s, 0.5);
  }
}

TEST_F(Checkpoint, KeepsChangedNoiseAndResolutionTakenOrNot) {
  Simulation whole(lift());
  whole.setLoadCellNoise(77.0);
  whole.advance(0.1);
  whole.setLoadCellResolution(25.0);
  whole.save(file_);
  Simulation resumed = Simulation::load(file_);
  EXPECT_EQ(resumed.loadCellNoise(), 77.0);
  EXPECT_EQ(resumed.loadCellResolution(), 25.0);
  for (int k = 0; k < 20; ++k) {
    whole.advance(whole.samplePeriod());
    resumed.advance(whole.samplePeriod());
    ASSERT_EQ(resumed.snapshot().force_n, whole.snapshot().force_n);
    ASSERT_EQ(std::remainder(whole.snapshot().force_n, 25.0), 0.0);
  }
  EXPECT_EQ(resumed.stateHash(), whole.stateHash());
}

TEST_F(Checkpoint, KeepsWhoSleeps) {
  Scenario s = lift();
  s.field.length_x_m = s.field.length_y_m = 6.0;
  s.procedure.lift_speed_mps = 0.05;
  Simulation simulation(s);
  // Share of the particles that are awake at the end of a piece of time.
  const auto awakeAfter = [&](double duration_s) {
    simulation.advance(duration_s);
    const std::uint64_t before = simulation.activeParticleSteps();
    simulation.advance(simulation.timeStep());
    return static_cast<double>(simulation.activeParticleSteps() - before) /
           static_cast<double>(simulation.particleCount());
  };
  // At rest before the lift, and in it, when some wake up again.
  for (const double duration_s : {0.45, 0.2}) {
    const double awake = awakeAfter(duration_s);
    ASSERT_GT(awake, 0.05) << simulation.snapshot().time_s;
    ASSERT_LT(awake, 0.95) << simulation.snapshot().time_s;
    expectSameFuture(s, simulation.snapshot().time_s + 0.5, 1.0);
  }
}

TEST_F(Checkpoint, DoesNotDependOnTheActiveSetBeingOn) {
  Scenario s = lift();
  s.solver.active_set = false;
  expectSameFuture(s, 1.0, 0.5);
}

TEST_F(Checkpoint, ResumesWithAnotherNumberOfThreads) {
  expectSameFuture(lift(), 1.2, 0.5, 2);
}

TEST_F(Checkpoint, KeepsDamageAndVariableSmoothingLength) {
  Scenario s = lift();
  s.ice.damage = true;
  expectSameFuture(s, 1.2, 0.5);
  s.solver.smoothing_length = SmoothingLength::kVariable;
  expectSameFuture(s, 1.2, 0.5);
}

TEST_F(Checkpoint, KeepsTheStateOfEveryEffect) {
  const std::vector<std::vector<std::string>> groups = {
      {"freeze_bonds", "refreezing", "rate_dependence"},
      {"drainage", "block_drop", "porosity_gradient", "thickness_field"},
      {"vessel_heave", "crane_speed", "pole_tilt", "compliance", "collector_hydrodynamics"},
      {"load_cell_bias", "load_cell_drift", "load_cell_scale", "load_cell_lag"}};
  std::size_t count = 0;
  for (const auto& group : groups) {
    SCOPED_TRACE(group.front());
    Scenario s = lift();
    for (const std::string& name : group) enable(s, name);
    s.effects["block_drop"].set("time_1_s", 1.2);
    expectSameFuture(s, 1.6, 0.5);
    count += group.size();
  }
  EXPECT_EQ(count, effectRegistry().size()) << "an effect is in none of the groups";
  Scenario all = lift();
  for (const EffectDescription& effect : effectRegistry()) enable(all, effect.name);
  expectSameFuture(all, 1.2, 0.3);
}

TEST_F(Checkpoint, KeepsTheEnergyBalance) {
  Scenario s = lift();
  s.output.energy = true;
  expectSameFuture(s, 1.0, 0.3);
}

TEST_F(Checkpoint, KeepsTareCommandsAndWhatWaitsInTheMailbox) {
  Scenario s = rigInTheAir();
  s.crane.command_timeout_s = 0.5;
  Simulation whole(s);
  whole.advance(0.6);
  whole.tare();
  whole.setCraneVelocity({0.1, 0.0, 0.2});
  whole.setFoldTarget(0.7);
  whole.advance(0.1);
  whole.setCraneVelocity({0.0, 0.1, -0.2});  // not taken yet
  whole.save(file_);
  Simulation resumed = Simulation::load(file_);
  whole.advance(0.3);
  resumed.advance(0.3);
  expectSame(resumed, whole);
  EXPECT_EQ(resumed.snapshot().rig.crane_position_m, whole.snapshot().rig.crane_position_m);
  EXPECT_LT(resumed.snapshot().rig.crane_velocity_mps.z(), 0.0) << "the command in the mailbox was lost";
  whole.advance(0.5);
  resumed.advance(0.5);
  EXPECT_TRUE(resumed.snapshot().flags.has(StatusFlag::kCommandTimeout)) << "the age of the command was lost";
  EXPECT_EQ(resumed.stateHash(), whole.stateHash());
}

TEST_F(Checkpoint, WithAMotionFileGoesOnOnlyAlongTheSameMotion) {
  const std::string corners = "time_s,hoist_position_m\n0,0\n0.7,0.2\n1.5,0.3\n";
  Scenario s = lift();
  s.procedure.motion_file = directory_.put("motion.csv", corners);
  expectSameFuture(s, 1.0, 0.6);
  directory_.put("motion.csv", "time_s,hoist_position_m\n0,0\n0.7,0.2\n1.5,0.31\n");
  try {
    Simulation::load(file_);
    ADD_FAILURE() << "went on along another motion";
  } catch (const ConfigError& error) {
    EXPECT_EQ(std::string(error.what()), file_ + ": section world: procedure.motion_file, " + s.procedure.motion_file +
                                             ", has changed since it was saved");
  }
  std::filesystem::remove(s.procedure.motion_file);
  try {
    Simulation::load(file_);
    ADD_FAILURE() << "went on without its motion";
  } catch (const ConfigError& error) {
    EXPECT_EQ(std::string(error.what()).rfind(file_ + ": its scenario: ", 0), 0u) << error.what();
    EXPECT_NE(std::string(error.what()).find("motion.csv"), std::string::npos) << error.what();
  }
}

TEST_F(Checkpoint, HoldsTheScenario) {
  Scenario s = lift();
  s.title = "Title with \"quotes\" and \n a second line";
  s.ice.cohesion_pa = 123.456789012345678;
  Simulation(s).save(file_);
  EXPECT_EQ(keyValues(CheckpointReader(file_).scenario()), keyValues(s));
}

TEST_F(Checkpoint, StateHashSeesWhoSleepsAndWhatGradientsReferTo) {
  // Quiet for a shorter time before it sleeps: the same positions for a while, and another future.
  Scenario s = lift();
  Simulation a(s);
  s.solver.quiet_time_s = 0.2;
  Simulation b(s);
  a.advance(0.05);
  b.advance(0.05);
  EXPECT_EQ(a.stateHash(), b.stateHash());
  while (a.activeParticleSteps() == b.activeParticleSteps() && a.stepCount() < 500) {
    a.advance(a.timeStep());
    b.advance(b.timeStep());
  }
  EXPECT_NE(a.stateHash(), b.stateHash());
}

// ---- what is refused

class BadCheckpoint : public Checkpoint {
 protected:
  void SetUp() override {
    Scenario s = lift();
    s.field.length_x_m = s.field.length_y_m = 3.6;
    save(s);
  }

  void save(const Scenario& scenario) {
    Simulation simulation(scenario);
    simulation.advance(0.6);
    simulation.save(file_);
    content_ = readFile(file_);
    ASSERT_GT(content_.size(), 100000u);
  }

  /// What is said about a file; empty: it was accepted.
  std::string refusalOf(const std::string& content) {
    std::ofstream(file_, std::ios::binary) << content;
    try {
      Simulation::load(file_);
    } catch (const ConfigError& error) {
      EXPECT_EQ(std::string(error.what()).rfind(file_, 0), 0u) << "does not begin with the file: " << error.what();
      return std::string(error.what()).substr(std::min(file_.size() + 2, std::strlen(error.what())));
    }
    return "";
  }

  /// With a hash that fits: whoever forges a file can do that.
  static std::string sealed(std::string content) {
    const std::uint64_t size = content.size();
    std::memcpy(&content[16], &size, sizeof size);
    Hash hash;
    hash.add(content.data(), content.size() - 8);
    const std::uint64_t value = hash.value();
    std::memcpy(&content[content.size() - 8], &value, sizeof value);
    return content;
  }

  /// Where the elements of a field begin.
  std::size_t placeOf(const std::string& field) const {
    const std::string head = static_cast<char>(field.size()) + field;
    const std::size_t at = content_.find(head);
    EXPECT_NE(at, std::string::npos) << field;
    return at + head.size() + 9;
  }

  template <class Value>
  std::string withValue(std::size_t at, const Value& value) const {
    std::string changed = content_;
    std::memcpy(&changed[at], &value, sizeof value);
    return changed;
  }

  /// With another number of elements in a field of the world, zeros where there were none.
  std::string withLength(const std::string& field, std::size_t element_size, std::uint64_t length) const {
    std::string changed = content_;
    const std::size_t at = placeOf(field);
    std::uint64_t before = 0, section_size = 0;
    std::memcpy(&before, &changed[at - 8], sizeof before);
    std::memcpy(&changed[at - 8], &length, sizeof length);
    changed.replace(at, before * element_size, length * element_size, '\0');
    const std::size_t section = changed.find(std::string("world") + std::string(19, '\0')) + 24;
    std::memcpy(&section_size, &changed[section], sizeof section_size);
    section_size += (length - before) * element_size;
    std::memcpy(&changed[section], &section_size, sizeof section_size);
    return changed;
  }

  std::string content_;
};

TEST_F(BadCheckpoint, SealedAgainIsStillGood) {
  EXPECT_EQ(refusalOf(sealed(content_)), "") << "or the tests below prove nothing";
}

TEST_F(BadCheckpoint, CutOffAnywhereIsRefused) {
  for (std::size_t part = 0; part < 16; ++part) {
    const std::string refusal = refusalOf(content_.substr(0, content_.size() * part / 16));
    EXPECT_TRUE(refusal.find("is damaged") != std::string::npos || refusal.find("cut off") != std::string::npos)
        << part << ": " << refusal;
  }
  for (const std::size_t size : {1u, 8u, 23u, 24u, 31u, 32u, 33u}) {
    EXPECT_NE(refusalOf(content_.substr(0, size)), "") << size;
  }
  EXPECT_NE(refusalOf(content_.substr(0, content_.size() - 1)), "");
  EXPECT_NE(refusalOf(content_ + 'x'), "");
}

TEST_F(BadCheckpoint, AnyFlippedBitIsRefused) {
  for (std::size_t at = 0; at < content_.size(); at += content_.size() / 60) {
    std::string flipped = content_;
    flipped[at] = static_cast<char>(flipped[at] ^ 1 << at % 8);
    EXPECT_NE(refusalOf(flipped), "") << "byte " << at;
  }
  for (std::size_t at = content_.size() - 9; at < content_.size(); ++at) {
    std::string flipped = content_;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x80);
    EXPECT_EQ(refusalOf(flipped), "is damaged: its checksum is wrong") << "byte " << at;
  }
}

TEST_F(BadCheckpoint, OfAnotherKindVersionOrByteOrderIsRefusedByName) {
  EXPECT_EQ(refusalOf("field: {spacing_m: 0.3}\n"),
            "is not a checkpoint of brash_ice_rig, or one that was cut off at its beginning");
  EXPECT_EQ(refusalOf(std::string(content_.size(), '\0')),
            "is not a checkpoint of brash_ice_rig, or one that was cut off at its beginning");
  EXPECT_EQ(refusalOf(sealed(withValue(12, std::uint32_t{7}))), "has format version 7, but this program reads 2 only");
  EXPECT_EQ(refusalOf(sealed(withValue(8, std::uint32_t{0x04030201}))),
            "was written on a machine of the other byte order");
}

TEST_F(BadCheckpoint, ThatIsNoFileIsRefusedWithoutWaitingForIt) {
  const auto refusal = [](const std::string& path) -> std::string {
    try {
      CheckpointReader reader(path);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  const std::string pipe = directory_.file("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(refusal(pipe), pipe + ": is not a file");
  EXPECT_EQ(refusal("/dev/zero"), "/dev/zero: is not a file");
  EXPECT_EQ(refusal(directory_.path()), directory_.path() + ": is not a file");
  EXPECT_EQ(refusal(directory_.file("nowhere")),
            directory_.file("nowhere") + ": file cannot be read: No such file or directory");
}

TEST_F(BadCheckpoint, WithForgedSizesIsRefusedBeforeAnythingIsAllocated) {
  const std::uint64_t huge = ~std::uint64_t{0} / 8;
  // Size of the first section; number of elements of an array, of a text, of the scenario.
  EXPECT_NE(refusalOf(sealed(withValue(24 + 24, huge))), "");
  for (const char* field : {"position_m", "stress_sum_pa", "generator", "yaml"}) {
    for (const std::uint64_t count : {huge, std::uint64_t{1} << 40, std::uint64_t{0}}) {
      EXPECT_NE(refusalOf(sealed(withValue(placeOf(field) - 8, count))), "") << field << " " << count;
    }
  }
  // A scenario of a million particles, of which the file has none.
  std::string scenario = content_;
  const std::size_t at = scenario.find("length_x_m: 3.6");
  ASSERT_NE(at, std::string::npos);
  scenario.replace(at, 15, "length_x_m: 999");
  EXPECT_EQ(refusalOf(sealed(scenario)), "holds fewer particles than its scenario has");
}

TEST_F(BadCheckpoint, WithForgedValuesIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const char* field : {"position_m", "reference_m", "searched_position_m"}) {
    EXPECT_EQ(refusalOf(sealed(withValue(placeOf(field), nan))), "section world: a position or velocity is not finite")
        << field;
  }
  EXPECT_EQ(refusalOf(sealed(withValue(placeOf("volume_m3"), -1.0f))),
            "section world: a volume or smoothing length is out of range");
  EXPECT_EQ(refusalOf(sealed(withValue(placeOf("longest_at_search_m"), 1.0e9))),
            "section world: a smoothing length is out of range");
  EXPECT_EQ(refusalOf(sealed(withValue(placeOf("stage"), std::uint32_t{99}))),
            "section world: there is no such stage of the procedure");
  // All particles in one place: each would be each other's neighbour.
  std::string heap = content_;
  std::memset(&heap[placeOf("searched_position_m")], 0, 576 * 24);
  EXPECT_EQ(refusalOf(sealed(heap)), "section world: particles lie denser than ice can be");
  // A field by another name, and one that only the hash of the state can tell.
  std::string renamed = content_;
  renamed[placeOf("arm_rate_radps") - 10] = 'x';
  EXPECT_EQ(refusalOf(sealed(renamed)),
            "section world: was written by a program that keeps other things: there is no arm_rate_radps");
  EXPECT_EQ(refusalOf(sealed(withValue(placeOf("arm_rate_radps"), 0.5))),
            "section books: the world came out otherwise than it was saved");
}

TEST_F(BadCheckpoint, WithForgedLengthsOfArraysIsRefused) {
  // No effect of this scenario has any of these.
  for (const char* field : {"strength_ratio", "solid_ratio", "held_water_kg"}) {
    EXPECT_EQ(refusalOf(sealed(withLength(field, 4, 0))), "") << "or the next line proves nothing";
    for (const std::uint64_t length : {1, 576}) {
      EXPECT_EQ(
          refusalOf(sealed(withLength(field, 4, length))),
          std::string("section world: ") + field + " has " + std::to_string(length) + " values of 4 bytes, not 0 of 4");
    }
  }
  // What an effect fills at its first step, which is part of making it.
  Scenario s = lift();
  s.field.length_x_m = s.field.length_y_m = 3.6;
  enable(s, "drainage");
  save(s);
  for (const std::uint64_t length : {0, 575}) {
    EXPECT_EQ(refusalOf(sealed(withLength("held_kg", 8, length))),
              "section world: held_kg has " + std::to_string(length) + " values of 8 bytes, not 576 of 8");
  }
}

TEST_F(BadCheckpoint, OfARefusedScenarioSaysWhichKey) {
  std::string scenario = content_;
  const std::size_t at = scenario.find("cohesion_pa: ");
  ASSERT_NE(at, std::string::npos);
  scenario.replace(at, 13, "cohesion_xy: ");
  EXPECT_NE(refusalOf(sealed(scenario)).find("unknown key ice.cohesion_xy"), std::string::npos);
}

// ---- writing

TEST_F(Checkpoint, ReplacesTheOneBeforeAndLeavesNothingElse) {
  Simulation simulation(lift());
  simulation.save(file_);
  simulation.advance(0.1);
  simulation.save(file_);
  EXPECT_EQ(Simulation::load(file_).stepCount(), simulation.stepCount());
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_.path()), {}), 1);
}

TEST_F(Checkpoint, ThatCannotBeWrittenSaysSoAndLeavesTheOneBefore) {
  Simulation simulation(lift());
  simulation.save(file_);
  const std::string before = readFile(file_);
  simulation.advance(0.1);
  std::filesystem::create_directory(file_ + ".partial");  // in the way
  EXPECT_THROW(simulation.save(file_), OutputError);
  EXPECT_EQ(readFile(file_), before);
  EXPECT_THROW(simulation.save(directory_.file("nowhere/checkpoint.bin")), OutputError);
}

TEST_F(Checkpoint, OfAFrozenWorldIsNotWritten) {
  Scenario s = lift();
  s.contact.min_stiffness_npm = 1.0e12;  // far too stiff for this step
  Simulation simulation(s);
  for (int k = 0; k < 400 && !simulation.frozen(); ++k) simulation.advance(0.05);
  ASSERT_TRUE(simulation.frozen());
  try {
    simulation.save(file_);
    ADD_FAILURE() << "was written";
  } catch (const OutputError& error) {
    EXPECT_NE(std::string(error.what()).find("frozen"), std::string::npos);
  }
  EXPECT_FALSE(std::filesystem::exists(file_));
}

}  // namespace
}  // namespace brash_ice_rig
