#include "brash_ice_rig/config/edit_distance.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

TEST(EditDistance, IsLevenshteins) {
  // Worked examples of Wagner and Fischer's algorithm in textbooks: kitten to sitting 3, intention to execution 5
  // (Jurafsky and Martin, Speech and Language Processing, section 2.5).
  EXPECT_EQ(editDistance("kitten", "sitting"), 3);
  EXPECT_EQ(editDistance("intention", "execution"), 5);
  EXPECT_EQ(editDistance("", "abc"), 3);
  EXPECT_EQ(editDistance("abc", ""), 3);
  EXPECT_EQ(editDistance("same", "same"), 0);
}

TEST(NearestWord, IsTheOneWithTheLeastDistance) {
  EXPECT_EQ(nearestWord({"cases", "grid", "sample"}, "case"), "cases");
  EXPECT_EQ(nearestWord({"cases", "grid", "sample"}, "gird"), "grid");
  EXPECT_EQ(nearestWord({"B-1", "B-2"}, "B-3"), "B-1") << "the first of several";
}

}  // namespace
}  // namespace brash_ice_rig
