#include "brash_ice_rig/node/split_list.h"

#include <gtest/gtest.h>

namespace brash_ice_rig {
namespace {

using Entries = std::vector<std::string>;

TEST(SplitList, SemicolonsSeparateAndSpacesAroundEntriesGo) {
  EXPECT_EQ(splitList("a.yaml; b c.yaml ;d"), (Entries{"a.yaml", "b c.yaml", "d"}));
}

TEST(SplitList, EmptyEntriesAreDropped) {
  EXPECT_EQ(splitList(""), Entries{});
  EXPECT_EQ(splitList(" ; ;"), Entries{});
  EXPECT_EQ(splitList(";a;;b;"), (Entries{"a", "b"}));
}

}  // namespace
}  // namespace brash_ice_rig
