// What identifies the patient stays in the headers, wherever people have typed it.
#include "segmentation/intake/identity.hpp"

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using segmentation::Identity;
using segmentation::ImageHeader;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

Identity of_patient(const std::string& name, const std::string& id, const std::string& born) {
  ImageHeader header;
  header.data_set = {{"PatientName", name}, {"PatientID", id}, {"PatientBirthDate", born}};
  Identity identity;
  identity.add(header);
  return identity;
}

TEST(Identity, IsTakenOutOfTextsInEverySpelling) {
  const Identity identity = of_patient("Quixotl^Jos\u00e9 Li", "MRN-7654321", "19850703");
  for (const char* text :
       {"Quixotl",     "QUIXOTL",     "quixotl",    "jose",         "JOS\u00c9",    "Jose\u0301",
        "MRN-7654321", "mrn7654321",  "7654321",    "19850703",     "1985-07-03",   "3.7.1985",
        "03.07.1985",  "07/03/1985",  "03071985",   "850703",       "3 Jul 1985",   "03-JUL-1985",
        "jul 3 1985",  "03.07.85",    "1985_07_03", "July 3, 1985", "3. July 1985", "76-54-321",
        "765 43 21",   "mrn 76.54321"})
    EXPECT_EQ(identity.removed_from(std::string("T2 ") + text + ", axial"), "T2 [removed], axial") << text;
  for (const char* text : {"3. Juli 1985", "3 juillet 1985", "3 de julio de 1985", "1985. j\u00falius 3",
                           "3 \u0438\u044e\u043b\u044f 1985", "3 VII 1985", "3.VII.85", "03-JUL-85",
                           "3Juil1985", "1985\u5e747\u67083", "3 th\u00e1ng 7 n\u0103m 1985",
                           "\u0663 \u064a\u0648\u0644\u064a\u0648 \u0661\u0669\u0668\u0665",
                           "\uff13.\uff17.\uff11\uff19\uff18\uff15"})
    EXPECT_EQ(identity.removed_from(std::string("T2 ") + text + ", axial"), "T2 [removed], axial") << text;
  EXPECT_EQ(identity.removed_from("T203.07.1985 JUL031985"), "T2[removed] [removed]");
  EXPECT_EQ(identity.removed_from("QuixotlJose_T2"), "[removed]_T2");
  for (const char* text : {"AX T2 FSE li 2021", "orbit 0.4 mm, 1985 ms, TE 91", "\u7720\u79d1 T1"})
    EXPECT_EQ(identity.removed_from(text), text);
  EXPECT_EQ(of_patient("Yamada^Tarou=\u5c71\u7530^\u592a\u90ce", "", "").removed_from("\u5c71\u7530 T2"),
            "[removed] T2");
  EXPECT_EQ(of_patient("", "", "").removed_from("AX T2"), "AX T2");
}

TEST(Identity, IsTakenOutHoweverItsLettersAreSpeltOut) {
  const auto removed = [](const char* name, const std::string& text) {
    return of_patient(name, "", "").removed_from("T1 " + text + " head");
  };
  for (const char* text : {"M\u00fcller", "Mueller", "MUELLER", "muller"}) {
    EXPECT_EQ(removed("M\u00fcller", text), "T1 [removed] head") << text;
    EXPECT_EQ(removed("Mueller", text),
              std::string(text) == "muller" ? "T1 muller head" : "T1 [removed] head")
        << text;
  }
  EXPECT_EQ(removed("Gr\u00f6\u00dfe", "GROESSE"), "T1 [removed] head");
  EXPECT_EQ(removed("S\u00f8rensen", "Soerensen"), "T1 [removed] head");
  EXPECT_EQ(removed("Aagaard", "\u00c5gaard"), "T1 [removed] head");
  EXPECT_EQ(removed("\u0141ukasz", "Lukasz"), "T1 [removed] head");
  EXPECT_EQ(removed("S\u00f8rensen", "Sorensen"), "T1 [removed] head");
  EXPECT_EQ(removed("\u0110or\u0111evi\u0107", "Dordevic"), "T1 [removed] head");
  EXPECT_EQ(removed("Y\u0131ld\u0131z", "YILDIZ"), "T1 [removed] head");
  EXPECT_EQ(removed("\u00de\u00f3rsd\u00f3ttir", "Thorsdottir"), "T1 [removed] head");
  EXPECT_EQ(removed("Mu\u0308ller", "Mueller"), "T1 [removed] head");
  EXPECT_EQ(removed("Mueller", "Mu\u0308ller"), "T1 [removed] head");
}

TEST(Identity, LeavesWhatOnlyResemblesIt) {
  const auto kept = [](const char* name, const char* id, const char* born, const std::string& text) {
    EXPECT_EQ(of_patient(name, id, born).removed_from(text), text);
  };
  kept("L\u00fc^Wei", "", "", "b-value 1000");
  kept("R\u00fc^Jo", "", "", "TrueFISP");
  kept("", "", "19501002", "DWI b 50 100 200");
  kept("", "", "20000510", "DWI b100 500 1000");
  kept("", "12345", "", "T2 TSE 3mm 0.4x0.4");
  kept("", "", "20010101", "MPRAGE 1 x 1 x 1 mm");
  kept("", "", "20000503", "SPACE 0.5 x 0.5 x 3 mm");
  kept("", "", "20000502", "T2 DWI b2000");
  kept("", "", "20000503", "3D DWI b2000");
  kept("", "", "19850703", "0.3 mm, 1985 ms");
}

TEST(Identity, PartsTooShortToTellAloneAreTakenOutWhereTheyStandTogether) {
  const auto removed = [](const char* name, const std::string& text) {
    EXPECT_EQ(of_patient(name, "", "").removed_from("T2 " + text + " orbit"), "T2 [removed] orbit")
        << name << ": " << text;
  };
  for (const char* text : {"\u738b\u4f1f", "\u738b \u4f1f", "\u4f1f^\u738b"}) {
    removed("\u738b^\u4f1f", text);
    removed("Wang^Wei=\u738b^\u4f1f", text);
  }
  removed("\u91d1^\u4fca=\uae40^\uc900", "\uae40\uc900");
  removed("\u91d1^\u4fca=\uae40^\uc900", "\u91d1\u4fca");
  removed("\u68ee^\u5065", "\u68ee\u5065");
  removed("\u738b^\u5c0f\u4e1c", "\u738b\u5c0f\u4e1c");
  for (const char* text : {"NG LI", "li, ng", "Ng^Li", "NgLi"}) removed("Ng^Li", text);
  for (const char* text : {"WU^JO", "Jo Wu", "WU_JO"}) removed("Wu^Jo", text);
  removed("Ng^Li^Jo", "li jo ng");
  removed("Hudson^Jo", "JO HUDSON");
}

TEST(Identity, ShortPartsOfANameAreWordsOfProtocolsWhereTheyStandAlone) {
  for (const char* text : {"T2 AX LI TSE", "t1 li orbit", "NG T1 LI", "English", "sing li"})
    EXPECT_EQ(of_patient("Ng^Li", "", "").removed_from(text), text);
  EXPECT_EQ(of_patient("\u738b^\u4f1f", "", "").removed_from("\u738b T2"), "\u738b T2");
  // Syllables that begin with the same letters.
  EXPECT_EQ(of_patient("\uae40\uc900", "", "").removed_from("\uac00\uc871 T2"), "\uac00\uc871 T2");
}

TEST(Identity, EveryOfSeveralNumbersIsTakenOut) {
  ImageHeader header;
  header.data_set = {{"OtherPatientIDs", "AB-12 \\ CD34"}};
  Identity identity;
  identity.add(header);
  EXPECT_EQ(identity.removed_from("T2 ab12, T1 CD34, CD 3"), "T2 [removed], T1 [removed], CD 3");
}

TEST(Identity, NothingOfItStaysInTheHeader) {
  ImageHeader header;
  for (const auto& tag : segmentation::tag::of_identity) header.data_set[tag.keyword] = "Marple 12345";
  Identity identity;
  identity.add(header);
  header.description = "T2 marple 12345";
  identity.remove_from(header);
  EXPECT_THAT(header.data_set, ::testing::IsEmpty());
  EXPECT_EQ(header.description, "T2 [removed]");
}

TEST(Identity, TheIssuerOfTheNumberIsPartOfIt) {
  ImageHeader header;
  header.data_set = {{"IssuerOfPatientID", "St. Anna ADT"}};
  Identity identity;
  identity.add(header);
  EXPECT_EQ(identity.removed_from("T2 ST ANNA ADT"), "T2 [removed]");
}

TEST_F(IntakeTest, DescriptionsNameNeitherStaffNorPlaceNorDate) {
  GeneratedSeries series;
  series.set_all(DCM_InstitutionName, "St. Anna Eye Hospital");
  series.set_all(DCM_StationName, "MRC25326");
  series.set_all(DCM_ReferringPhysicianName, "WATSON^J");
  series.set_all(DCM_PerformingPhysicianName, "Doyle^Arthur");
  series.set_all(DCM_OperatorsName, "Hudson");
  series.set_all(DCM_StudyDate, "20240503");
  series.set_all(DCM_SeriesDescription,
                 "eye T2 St Anna Eye Hospital mrc-25326 Watson doyle HUDSON 3 May 2024");
  series.write(folder());
  EXPECT_EQ(only_series().description, "eye T2 [removed] [removed] [removed] [removed] [removed] [removed]");
}

TEST_F(IntakeTest, DescriptionsNameNeitherFamilyNorNumbersOfTheVisit) {
  GeneratedSeries series;
  for (const auto& [tag, value] : {std::pair{DCM_PatientMotherBirthName, "Marple^Jane"},
                                   {DCM_RequestingPhysician, "Poirot"},
                                   {DCM_NameOfPhysiciansReadingStudy, "Hastings^A"},
                                   {DCM_StudyID, "STID8876"},
                                   {DCM_AdmissionID, "ADM-3344"},
                                   {DCM_PatientTelephoneNumbers, "0931-555777"},
                                   {DCM_PatientAddress, "12 Baker Street, London"},
                                   {DCM_DeviceSerialNumber, "35235"}})
    series.set_all(tag, value);
  series.set_all(DCM_SeriesDescription,
                 "T2 marple POIROT hastings stid8876 adm3344 0931 555777 12 baker street london 35235");
  series.write(folder());
  EXPECT_EQ(only_series().description,
            "T2 [removed] [removed] [removed] [removed] [removed] [removed] [removed] [removed]");
}

TEST_F(IntakeTest, DescriptionsNameNeitherGuardianNorTrialNorOrder) {
  GeneratedSeries series;
  for (const auto& [tag, value] : {std::pair{DCM_ResponsiblePerson, "Holmes^Mycroft"},
                                   {DCM_ConsultingPhysicianName, "Lestrade^G"},
                                   {DCM_RETIRED_MedicalRecordLocator, "LOCATOR-77"},
                                   {DCM_ClinicalTrialSubjectID, "SUBJ-0042"},
                                   {DCM_ClinicalTrialSubjectReadingID, "READ-0043"},
                                   {DCM_PlacerOrderNumberImagingServiceRequest, "PLC123456"},
                                   {DCM_FillerOrderNumberImagingServiceRequest, "FIL-654321"},
                                   {DCM_RequestedProcedureID, "RP-10017"},
                                   {DCM_PerformedProcedureStepID, "PPS20018"},
                                   {DCM_AcquisitionDate, "20240504"},
                                   {DCM_SeriesDate, "20240505"}})
    series.set_all(tag, value);
  series.set_all(
      DCM_SeriesDescription,
      "holmes, LESTRADE, locator 77, subj0042, read-0043, plc123456, fil654321, rp10017, pps-20018, "
      "4 May 2024, 2024-05-05");
  series.write(folder());
  EXPECT_EQ(only_series().description,
            "[removed], [removed], [removed], [removed], [removed], [removed], [removed], [removed], "
            "[removed], [removed], [removed]");
}

TEST_F(IntakeTest, ShortNumbersAndWordsInTheirPlaceAreLeft) {
  GeneratedSeries series;
  series.set_all(DCM_StudyID, "100");
  series.set_all(DCM_AdmissionID, "BRAIN");
  series.set_all(DCM_RequestedProcedureID, "1");
  series.set_all(DCM_PerformedProcedureStepID, "12");
  series.set_all(DCM_SeriesDescription, "BRAIN TR 1000 3D 12ch");
  series.write(folder());
  EXPECT_EQ(only_series().description, "BRAIN TR 1000 3D 12ch");
}

TEST_F(IntakeTest, ImageTypesNameNobodyAndKeepTheirTerms) {
  const auto type = [&](const char* name, const char* text) {
    GeneratedSeries series;
    series.set_all(DCM_PatientName, name);
    series.set_all(DCM_ImageType, text);
    series.write(folder());
    return only_series().image_type;
  };
  EXPECT_EQ(type("Doyle^Arthur", "ORIGINAL\\PRIMARY\\M\\DOYLE_T2"), "ORIGINAL\\PRIMARY\\M\\[removed]_T2");
  EXPECT_EQ(type("Ng^Li", "ORIGINAL\\PRIMARY\\M\\NG_LI"), "ORIGINAL\\PRIMARY\\M\\[removed]");
  // Names that are parts of terms, or terms.
  EXPECT_EQ(type("M^Mary^Norm", "ORIGINAL\\PRIMARY\\M\\NORM\\MARY"), "ORIGINAL\\PRIMARY\\M\\NORM\\[removed]");
}

TEST_F(IntakeTest, AMapIsRefusedWhateverThePatientIsCalled) {
  GeneratedSeries series;
  series.set_all(DCM_PatientName, "Map^Min");
  series.set_all(DCM_ImageType, "DERIVED\\PRIMARY\\T2 MAP\\T2");
  series.write(folder());
  EXPECT_EQ(only_series().refusal, ExitStatus::unsupported);
  EXPECT_THAT(only_series().reason, HasSubstr("T2 MAP"));
}

TEST_F(IntakeTest, WhatACaseKeepsNamesNobody) {
  GeneratedSeries series;
  series.set_all(DCM_SpecificCharacterSet, "ISO_IR 192");
  series.set_all(DCM_SeriesDescription, "Name Secret T2 01.01.1986 SECRET-ID-77\u202e");
  series.set_all(DCM_BodyPartExamined, "FOOT SECRET");
  series.remove(6);
  series.write(folder() / "SECRET_NAME");
  const auto info = only_series();
  EXPECT_EQ(info.description, "[removed] [removed] T2 [removed] [removed]");
  EXPECT_THAT(info.body_part, Not(HasSubstr("SECRET")));
  // The terminal names the files on both sides of the gap, the case names the slices.
  EXPECT_THAT(info.warnings, testing::Contains(HasSubstr("SECRET_NAME/" + file_name(5))));
  EXPECT_THAT(info.kept.warnings,
              testing::Contains(HasSubstr("1 slice is missing between slice 1 and slice 11: ")));
  const std::string kept = kept_json(info).dump();
  EXPECT_THAT(kept, AllOf(Not(HasSubstr("SECRET")), Not(HasSubstr("1986")), Not(HasSubstr("scan/im"))));
}

TEST_F(IntakeTest, IdsOfASequenceAreKnownToo) {
  GeneratedSeries series;
  for (int slice = 0; slice < series.size(); ++slice) {
    DcmItem* item = nullptr;
    ASSERT_TRUE(series[slice].findOrCreateSequenceItem(DCM_OtherPatientIDsSequence, item, -2).good());
    ASSERT_TRUE(item->putAndInsertString(DCM_PatientID, "OLD-4711").good());
  }
  series.set_all(DCM_SeriesDescription, "T2 old4711");
  series.write(folder());
  EXPECT_EQ(only_series().description, "T2 [removed]");
}

TEST_F(IntakeTest, ARefusalNamesTheFileOnTheTerminalOnly) {
  GeneratedSeries series;
  series.set(4, DCM_PixelSpacing, "0.9\\0.9");
  series.write(folder());
  const auto info = only_series();
  EXPECT_FALSE(info.usable);
  EXPECT_THAT(info.reason, HasSubstr(file_name(4) + ": (0028,0030)"));
  EXPECT_THAT(info.kept.reason, AllOf(HasSubstr("slice 8: (0028,0030)"), Not(HasSubstr("scan/im"))));
}

// A hash of the study's UID and PatientID gave a short PatientID away to whoever tried all of them.
TEST_F(IntakeTest, ThePseudonymDoesNotDependOnThePatientsNumber) {
  const auto pseudonym = [&](const std::string& id, const std::string& study) {
    GeneratedSeries series;
    series.set_all(DCM_PatientID, id);
    series.set_all(DCM_StudyInstanceUID, study);
    series.write(folder());
    return inventory().subjects.at(study).id;
  };
  const std::string one = pseudonym("1", "1.2.3");
  EXPECT_EQ(one.size(), 16U);
  EXPECT_EQ(pseudonym("2", "1.2.3"), one);
  EXPECT_NE(pseudonym("1", "1.2.4"), one);
}

TEST_F(IntakeTest, AStudyWithoutAUidIsWarnedOfAndHasAPseudonymAllTheSame) {
  const auto pseudonym = [&](const char* series_uid) {
    GeneratedSeries series;
    series.erase_all(DCM_StudyInstanceUID);
    series.set_all(DCM_SeriesInstanceUID, series_uid);
    series.write(folder());
    const auto found = inventory();
    EXPECT_TRUE(found.series.at(0).usable);
    EXPECT_THAT(found.series[0].warnings,
                testing::Contains(HasSubstr("(0020,000d) StudyInstanceUID is absent")));
    return found.subject_of(found.series[0]).id;
  };
  const std::string one = pseudonym("1.2.3");
  EXPECT_EQ(one.size(), 16U);
  EXPECT_NE(pseudonym("1.2.4"), one);
}

}  // namespace
}  // namespace emmetrope::test
