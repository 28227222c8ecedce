//! Why a curve of the reference view was not matched.

/// Why a curve of the reference view was not matched: what most of its points failed, of those that could have had a
/// partner at all; of two reasons as frequent the later one.
///
/// The codes are recorded: a new reason gets a new one, and none is used twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Reason {
    /// It runs along the rows: no point of it is crossed by a row steeply enough to have one partner.
    Flat = 1,
    /// In the neighbouring view there is nothing with gradients like its own at any disparity that is searched.
    NoPartner = 2,
    /// Where the neighbouring view and it say, there is nothing like it in the third view.
    ThirdView = 3,
    /// Gray levels and gradients differ so much from every candidate's that to leave the point out costs less.
    Unlike = 4,
    /// No candidate fits the disparities of its neighbours along the curve.
    Unsteady = 5,
    /// Too few points in a row have one steady disparity.
    Short = 6,
    /// Candidates at other disparities are as good, as in a repeated texture.
    Ambiguous = 7,
    /// Another curve has a better claim to the same place of another view.
    NotUnique = 8,
    /// The points around it have other disparities.
    Neighbours = 9,
    /// Its points are too likely to be wrong.
    Unsure = 10,
    /// Assignment of whole curves: no curve of the neighbouring view collects enough votes.
    Votes = 11,
    /// Assignment of whole curves: from the last view the votes lead to another curve, or not to where the loop began.
    Loop = 12,
    /// Method point: too little is matched around it.
    Region = 13,
}

impl Reason {
    /// All of them, in the order of their codes.
    pub const ALL: [Self; 13] = [
        Self::Flat,
        Self::NoPartner,
        Self::ThirdView,
        Self::Unlike,
        Self::Unsteady,
        Self::Short,
        Self::Ambiguous,
        Self::NotUnique,
        Self::Neighbours,
        Self::Unsure,
        Self::Votes,
        Self::Loop,
        Self::Region,
    ];

    /// The number it is recorded as.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// The reason with this code; `None` for a code that a later version made.
    pub fn of(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.code() == code)
    }

    /// What it says in a few words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Flat => "too flat",
            Self::NoPartner => "no partner",
            Self::ThirdView => "third view disagrees",
            Self::Unlike => "gray levels differ",
            Self::Unsteady => "not smooth",
            Self::Short => "run too short",
            Self::Ambiguous => "ambiguous",
            Self::NotUnique => "not unique",
            Self::Neighbours => "neighbours disagree",
            Self::Unsure => "score too low",
            Self::Votes => "too few votes",
            Self::Loop => "loop does not close",
            Self::Region => "region hardly matches",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_is_found_by_its_code_and_has_words_of_its_own() {
        for (index, reason) in Reason::ALL.into_iter().enumerate() {
            assert_eq!(Reason::of(reason.code()), Some(reason));
            assert_eq!(reason.code() as usize, index + 1);
            let others = &Reason::ALL[index + 1..];
            assert!(others.iter().all(|other| other.words() != reason.words()));
        }
        assert_eq!(Reason::of(0), None);
        assert_eq!(Reason::of(14), None);
    }
}
