// Who was imaged, as far as headers agree on it.
#include "segmentation/intake/subject.hpp"

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using segmentation::parse_age_years;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(PatientAge, IsAPersons) {
  EXPECT_EQ(parse_age_years("026Y"), 26);
  EXPECT_EQ(parse_age_years("110Y"), 110);
  EXPECT_EQ(parse_age_years("480M"), 40);
  EXPECT_NEAR(parse_age_years("001D").value(), 1 / 365.25, 1e-12);
  for (const char* age : {"000Y", "000M", "000D", "111Y", "999Y", "-05Y", "-05X", "38", "0038"})
    EXPECT_FALSE(parse_age_years(age)) << age;
}

class Subjects : public IntakeTest {
 protected:
  struct Told {
    std::optional<double> age_years;
    std::vector<std::string> warnings;
  };
  /// \param age  PatientAge; empty: none
  Told told(const char* born, const char* studied, const std::string& age = "") {
    series_.set_all(DCM_PatientBirthDate, born);
    series_.set_all(DCM_StudyDate, studied);
    series_.set_all(DCM_PatientAge, age);
    series_.write(folder());
    const auto found = inventory();
    const auto& info = found.series.at(0);
    EXPECT_TRUE(info.usable) << info.reason;
    EXPECT_THAT(info.warnings, Not(Contains(HasSubstr(born))));
    return {found.subject_of(info).age_years, info.warnings};
  }
  GeneratedSeries series_;
};

/// Dates that programs put where they remove the true ones gave ages of 126 and of 0 years.
TEST_F(Subjects, HaveNoAgeByDatesThatAreNoPersons) {
  const auto by_dates = AllOf(HasSubstr("(0010,0030) PatientBirthDate"), HasSubstr("(0008,0020) StudyDate"));
  for (const char* born : {"19000101", "20260101", "20270101"}) {
    const Told odd = told(born, "20260101");
    EXPECT_FALSE(odd.age_years) << born;
    EXPECT_THAT(odd.warnings, Contains(AllOf(by_dates, HasSubstr("no age is taken from them")))) << born;
  }
  const Told usual = told("19860103", "20260102");
  EXPECT_EQ(usual.age_years, 39);
  EXPECT_THAT(usual.warnings, Not(Contains(by_dates)));
  // Where the age itself is told the dates are not needed.
  const Told removed = told("19000101", "20260101", "040Y");
  EXPECT_EQ(removed.age_years, 40);
  EXPECT_THAT(removed.warnings, Not(Contains(by_dates)));
  EXPECT_EQ(told("19860101", "20260601", "000Y").age_years, 40);
}

TEST_F(Subjects, AreAsOldAsToldWhereDatesContradict) {
  const auto contradicts = Contains(AllOf(HasSubstr("(0010,1010) PatientAge contradicts (0010,0030)"),
                                          HasSubstr("(0010,1010) PatientAge is used")));
  const Told odd = told("20200101", "20260101", "040Y");
  EXPECT_EQ(odd.age_years, 40);
  EXPECT_THAT(odd.warnings, contradicts);
  // Of the date of birth the year alone is told: almost two years at most.
  EXPECT_THAT(told("19850101", "20111230", "025Y").warnings, Not(contradicts));
  EXPECT_THAT(told("19300101", "20260101", "089Y").warnings, Not(contradicts));
  EXPECT_THAT(told("19300101", "20260101", "090Y").warnings, Not(contradicts));
  EXPECT_THAT(told("19860101", "20260101", "089Y").warnings, contradicts);
}

/// Anonymisers may shift the one and forget the other.
TEST_F(Subjects, ADateOfTheStudyThatIsNotTheAcquisitionsIsTold) {
  const auto contradicts =
      Contains(HasSubstr("(0008,0020) StudyDate contradicts (0008,0022) AcquisitionDate"));
  series_.set_all(DCM_AcquisitionDate, "20160101");
  EXPECT_THAT(told("19870412", "20260101").warnings, contradicts);
  EXPECT_THAT(told("19870412", "20160103").warnings, Not(contradicts));
}

/// Three series under one StudyInstanceUID, of which the first says nothing.
TEST_F(IntakeTest, SeriesOfTwoPeopleOrVisitsUnderOneStudyAreNotUsedTogether) {
  struct Case {
    DcmTagKey tag;
    const char *one, *other, *named;
    bool differs;
  };
  for (const Case& c : {Case{DCM_PatientSex, "F", "M", "(0010,0040)", true},
                        Case{DCM_PatientSex, "F", "O", "(0010,0040)", false},
                        Case{DCM_PatientAge, "038Y", "041Y", "(0010,1010)", true},
                        Case{DCM_PatientAge, "038Y", "039Y", "(0010,1010)", false},
                        Case{DCM_StudyDate, "20240503", "20270503", "(0008,0020)", true},
                        Case{DCM_StudyDate, "20240228", "20240301", "(0008,0020)", true},
                        Case{DCM_StudyDate, "20260228", "20260301", "(0008,0020)", false},
                        Case{DCM_StudyDate, "20240503", "2024.05.03", "(0008,0020)", false}}) {
    int number = 0;
    for (const char* value : {"", c.one, c.other}) {
      ++number;
      GeneratedSeries series("1.2.3.9" + std::to_string(number), number);
      series.set_all(c.tag, value);
      std::filesystem::create_directories(folder() / std::to_string(number));
      series.write(folder() / std::to_string(number));
    }
    const auto found = inventory();
    ASSERT_EQ(found.series.size(), 3U) << c.named;
    const auto told = [&](const char* other) {
      return Contains(AllOf(HasSubstr(c.named), HasSubstr(other), HasSubstr("they are not used together"),
                            Not(HasSubstr(c.one)), Not(HasSubstr("im"))));
    };
    EXPECT_THAT(found.series[0].warnings, Not(told("stack"))) << c.named;
    if (c.differs) {
      EXPECT_THAT(found.series[1].warnings, told("stack3")) << c.named;
      EXPECT_THAT(found.series[2].warnings, told("stack2")) << c.named;
    } else {
      EXPECT_THAT(found.series[1].warnings, Not(told("stack"))) << c.named << " " << c.other;
    }
    EXPECT_EQ(found.contradiction(found.series[1], found.series[2]).empty(), !c.differs);
  }
}

TEST_F(IntakeTest, AnAnimalIsWarnedOf) {
  for (const auto& [species, is_told] :
       {std::pair{"Canis lupus familiaris", true}, {"Homo sapiens (organism)", false}, {"HUMAN", false}}) {
    GeneratedSeries series;
    series.set_all(DCM_PatientSpeciesDescription, species);
    series.write(folder());
    const auto warned = Contains(HasSubstr("(0010,2201) PatientSpeciesDescription names no human"));
    if (is_told)
      EXPECT_THAT(only_series().warnings, warned) << species;
    else
      EXPECT_THAT(only_series().warnings, Not(warned)) << species;
  }
}

TEST_F(IntakeTest, FilesThatDifferInThePatientOrTheDateAreNamed) {
  struct Case {
    DcmTagKey tag;
    const char *one, *other, *named;
    bool differs;
  };
  for (const Case& c : {Case{DCM_PatientSex, "F", "M", "(0010,0040)", true},
                        Case{DCM_PatientAge, "040Y", "012Y", "(0010,1010)", true},
                        Case{DCM_PatientAge, "040Y", "041Y", "(0010,1010)", false},
                        Case{DCM_IssuerOfPatientID, "HOSPITAL A", "HOSPITAL B", "(0010,0021)", true},
                        Case{DCM_StudyDate, "20240503", "20240504", "(0008,0020)", true}}) {
    GeneratedSeries series;
    series.set_all(c.tag, c.one);
    series.set(7, c.tag, c.other);
    series.write(folder());
    const auto info = only_series();
    EXPECT_TRUE(info.usable) << info.reason;
    const auto named =
        Contains(AllOf(HasSubstr(c.named), HasSubstr(file_name(7)), HasSubstr("differs within the series"),
                       Not(HasSubstr(c.one)), Not(HasSubstr(c.other))));
    if (c.differs)
      EXPECT_THAT(info.warnings, named) << c.named;
    else
      EXPECT_THAT(info.warnings, Not(named)) << c.named;
  }
}

}  // namespace
}  // namespace emmetrope::test
