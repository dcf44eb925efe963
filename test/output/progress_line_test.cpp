#include "brash_ice_rig/output/progress_line.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

TEST(ProgressBar, ShowsShareAndTimeLeft) {
  EXPECT_EQ(progressBar(0.0, -1.0), "[........................]   0 %");
  EXPECT_EQ(progressBar(0.25, 65.0), "[######..................]  25 %  1:05 left");
  EXPECT_EQ(progressBar(1.0, 0.0), "[########################] 100 %  0:00 left");
  EXPECT_EQ(progressBar(0.5, 59.2), "[############............]  50 %  1:00 left") << "rounded up: not done before";
}

}  // namespace
}  // namespace brash_ice_rig
